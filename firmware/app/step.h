/* step.h: one control step, sensors -> model -> estimator -> autopilot -> PIDs -> mixer. Pure: no HAL, no clock.
 *
 *   model      predicts the motion from the previous step's voltages. If the battery is known to sag, the new battery
 *              reading corrects these voltages first.
 *   estimator  heading from the gyro, speed from prediction and sensors, pose by dead reckoning; a reference overrides
 *              all three
 *   monitor    compares the motion with the voltages, and names what makes a wheel differ from the model; nothing uses it
 *   autopilot  mode and line of sight: the speed and heading to hold
 *   control    one PID for the speed and one for the heading, eq. 21
 *   mixer      the voltages of both motors, with priority for heading, and their duty at this battery voltage
 */
#ifndef BRICKPILOT_APP_STEP_H
#define BRICKPILOT_APP_STEP_H

#include "autopilot/mode.h"
#include "control/pid.h"
#include "estimator/heading.h"
#include "estimator/pose.h"
#include "estimator/speed.h"
#include "mixer/mixer.h"
#include "model/body.h"
#include "monitor/monitor.h"

typedef struct {
    const body_coefficients_t
        *model; /* points to the caller's constants: no setting changes them, so RAM holds no copy */
    heading_config_t heading;
    speed_config_t speed;
    mode_config_t mode;
    pid_config_t speed_pid;
    pid_config_t heading_pid;
    int16_t feedforward_mv_q10; /* mV per 1/16 mm/s of demanded speed, to hold that speed on level ground, 0..32767 */
    mixer_config_t mixer;
#ifndef MONITOR_OFF
    const monitor_config_t *monitor; /* points to the caller's constants, as `model` does */
#endif
} step_config_t;

/* All fields are 0 at the start: the robot is at rest at the origin, and points along x. */
typedef struct {
    body_state_t model;
    heading_state_t heading;
    speed_state_t speed;
    pose_state_t pose;
    mode_state_t mode;
    pid_state_t speed_pid;
    pid_state_t heading_pid;
    mixer_state_t mixer;
#ifndef MONITOR_OFF
    monitor_state_t monitor;
#endif
    uint8_t lag_ms; /* time by which the model lags behind the sensors, less than BODY_PERIOD_MS */
} step_state_t;

/* The signals of one step, as its stages have written them. */
typedef struct {
    signals_predicted_t predicted;
    signals_estimate_t estimate;
    signals_demand_t demand;
    pid_output_t speed_pid; /* the P, I and D parts of both efforts, for telemetry */
    pid_output_t heading_pid;
    signals_effort_t effort;
    signals_drive_t drive;
} step_output_t;

/* One step of sensors->period_ms. `command` goes to mode_step(). Writes all of `output`. Never fails: a robot that must
 * not drive gets duty 0. */
void step_run(const step_config_t *config, const route_t *route, step_state_t *state, const signals_sensors_t *sensors,
              mode_command_t command, step_output_t *output);

#endif
