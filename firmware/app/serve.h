/* serve.h: reads the host's requests and sends the replies. commands.h lists the requests. */
#ifndef BRICKPILOT_APP_SERVE_H
#define BRICKPILOT_APP_SERVE_H

#include "app/commands.h"

/* Reads one message, if one has come, and replies. A new session stops the motors and clears the loop's state. Call it before
 * each loop_tick(), and as often as there is time. A host waits for the reply to a request before it sends the next
 * one. A host that does not wait takes no more time of a control period. */
void serve(commands_t *commands, loop_state_t *state);

#endif
