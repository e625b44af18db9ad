/* loop.h: the control loop, and the only caller of the HAL: reads what there is, runs the pipeline, writes the motors.
 *
 * Call loop_tick() every STEP_MS. It measures the period itself, so that a late tick is integrated over its true length;
 * one later than watchdog_ms counts as a failure of the clock or of the caller, and the run is aborted with motors off.
 * So it is when neither a sensor nor a command has been heard for silent_ms: only a reset and a new start drive again.
 */
#ifndef BRICKPILOT_APP_LOOP_H
#define BRICKPILOT_APP_LOOP_H

#include "app/step.h"

typedef struct {
    step_config_t step;
    uint16_t watchdog_ms;    /* longest period that a run survives, STEP_MS..20 */
    uint16_t silent_ms;      /* with no reading of any sensor and no message for longer, a run is cut */
    uint8_t telemetry_every; /* each part of the telemetry goes to the link every so many ticks, by turns; 0: never */
} loop_config_t;

/* All zero to begin with. */
typedef struct {
    step_state_t step;
    uint32_t tick;           /* since the start; wraps */
    uint32_t clock_ms;       /* of the newest tick */
    uint16_t late_ticks;     /* ticks more than a step late; stays at 65535 */
    uint16_t aborted_late;   /* runs that the watchdog ended; stays at 65535 */
    uint16_t aborted_silent; /* runs that silence ended; stays at 65535 */
    uint16_t silent_ms;      /* for how long nothing has been heard; stays at 65535 */
    uint8_t until_telemetry; /* ticks until its first part is due again */
    uint8_t next_part;
    uint8_t until_heartbeat;
    bool started;
    step_output_t output; /* of the newest tick */
} loop_state_t;

/* Takes the clock's time and stops the motors. Left out, the first tick takes the time. */
void loop_start(loop_state_t *state);

/* Something valid has come over the link: the run goes on although no sensor is heard. */
void loop_heard(loop_state_t *state);

/* One tick. `route` is what the autopilot flies; `command` as mode_step() takes it, MODE_NONE in most ticks. */
void loop_tick(const loop_config_t *config, const route_t *route, loop_state_t *state, mode_command_t command);

#endif
