/* serve.h: answers the host. The link's side of the loop: see commands.h for what may be asked. */
#ifndef BRICKPILOT_APP_SERVE_H
#define BRICKPILOT_APP_SERVE_H

#include "app/commands.h"

/* Reads every message there is and answers it. A new session stops the motors and begins the loop anew. Call it before each
 * loop_tick(), and as often as there is time. */
void serve(commands_t *commands, loop_state_t *state);

#endif
