/* telemetry.h: what the pipeline thinks, as messages of hal/wire/brickpilot.dbc. */
#ifndef BRICKPILOT_APP_TELEMETRY_H
#define BRICKPILOT_APP_TELEMETRY_H

#include "app/step.h"
#include "wire/message.h"

enum { TELEMETRY_PARTS = 7 };

/* Part 0..6 of the telemetry, TELEMETRY_X to TELEMETRY_EFFORT, of one step, of whose time `tick_ms` is the low byte. */
void telemetry_part(uint8_t part, uint8_t tick_ms, const step_state_t *state, const step_output_t *output,
                    message_t *message);

/* HEARTBEAT. `aborted` saturates at 255. */
void telemetry_heartbeat(uint32_t tick, uint16_t late_ticks, uint16_t aborted, const mode_state_t *mode,
                         message_t *message);

#endif
