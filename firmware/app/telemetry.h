/* telemetry.h: what the loop and its pipeline think, as messages of hal/wire/brickpilot.dbc. */
#ifndef BRICKPILOT_APP_TELEMETRY_H
#define BRICKPILOT_APP_TELEMETRY_H

#include "app/loop.h"
#include "wire/message.h"

enum { TELEMETRY_PARTS = 7, TELEMETRY_HEARTBEAT = TELEMETRY_PARTS };

/* Part 0..6 of the telemetry, TELEMETRY_X to TELEMETRY_EFFORT, of the newest tick; or TELEMETRY_HEARTBEAT. */
void telemetry_part(uint8_t part, const loop_state_t *state, message_t *message);

#endif
