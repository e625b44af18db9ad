/* loop.h: the control loop. A tick reads the sensors through the HAL, runs the step and writes the motors.
 *
 * Call loop_tick() every STEP_MS. It measures the period itself, so that a late tick is integrated over its true length.
 * A tick later than watchdog_ms is a failure of the clock or of the caller: the run is cut, with motors off. A tick
 * later than 20 ms always cuts the run, because the step integrates at most 20 ms.
 * A run also ends when no sensor reading and no message has come for silent_ms. After a cut the robot drives again
 * only after a reset and a new start.
 */
#ifndef BRICKPILOT_APP_LOOP_H
#define BRICKPILOT_APP_LOOP_H

#include "app/step.h"

typedef struct {
    step_config_t step;
    uint16_t watchdog_ms;    /* longest period that does not end a run, STEP_MS..20; larger values count as 20 */
    uint16_t silent_ms;      /* a run ends if neither a sensor reading nor a message comes for longer than this */
    uint8_t telemetry_every; /* each part of the telemetry is sent once in this number of ticks; 0: never */
} loop_config_t;

/* All fields are 0 at the start. */
typedef struct {
    step_state_t step;
    uint32_t tick;           /* ticks since the start; wraps */
    uint32_t clock_ms;       /* time of the newest tick */
    uint16_t late_ticks;     /* ticks that were late by STEP_MS or more; saturates at 65535 */
    uint16_t aborted;        /* number of runs that a late tick or silence ended; saturates at 65535 */
    uint16_t silent_ms;      /* time since a sensor or a message was heard; saturates at 65535 */
    uint8_t until_telemetry; /* ticks until the first part of the telemetry is due again */
    uint8_t next_part;
    uint8_t until_heartbeat;
#ifndef MONITOR_OFF
    uint8_t next_channel; /* channel of the monitor to be reported next */
#endif
    bool started;
    signals_sensors_t sensors; /* readings of the newest tick */
    step_output_t output;
} loop_state_t;

/* Reads the clock and stops the motors. Without this call the first tick reads the clock. */
void loop_start(loop_state_t *state);

/* Call this when a valid message has come over the link: it keeps a run going while no sensor delivers readings. */
void loop_heard(loop_state_t *state);

/* One tick. The autopilot flies `route`. `command` goes to mode_step(); in most ticks it is MODE_NONE. */
void loop_tick(const loop_config_t *config, const route_t *route, loop_state_t *state, mode_command_t command);

#endif
