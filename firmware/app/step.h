/* step.h: the pipeline, one control step: sensors -> estimator -> autopilot -> PIDs -> mixer. Pure: no HAL, no clock.
 *
 *   model      predicts from the voltages applied in the step before; the battery's next reading corrects them where it
 *              is known to sag
 *   estimator  heading from the gyro, speed from the prediction and the sensors, pose by dead reckoning;
 *              a reference overrides all
 *   autopilot  mode and line of sight: a speed and a heading to hold
 *   control    one PID each, eq. 21
 *   mixer      two voltages, heading first, and their duty at this battery
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

typedef struct {
    const body_coefficients_t *model; /* no setting changes it: a configuration in RAM does without */
    heading_config_t heading;
    speed_config_t speed;
    mode_config_t mode;
    pid_config_t speed_pid;
    pid_config_t heading_pid;
    int16_t feedforward_mv_q10; /* mV per 1/16 mm/s demanded: what holds that speed on level ground; 0..32767 */
    mixer_config_t mixer;
    uint16_t battery_nominal_mv; /* counts where no battery reading is to be had */
    bool battery_sags;           /* the model gets the voltage that a step turns out to have had */
} step_config_t;

/* All zero to begin with: at rest at the origin, heading along x. */
typedef struct {
    body_state_t model;
    heading_state_t heading;
    speed_state_t speed;
    pose_state_t pose;
    mode_state_t mode;
    pid_state_t speed_pid;
    pid_state_t heading_pid;
    mixer_state_t mixer;
    uint8_t ahead_ms; /* of the model's next step, gone by already: below it */
} step_state_t;

/* The estimator goes on from `state`: all zero to begin with, too. */
typedef struct {
    pid_terms_t speed; /* parts of the efforts */
    pid_terms_t heading;
    signals_effort_t effort;
    signals_state_t state; /* state.sensors is what the step is given */
} step_output_t;

/* One step. `command` as mode_step() takes it. Never fails; a robot that must not drive gets drive 0. */
void step_run(const step_config_t *config, const route_t *route, step_state_t *state, mode_command_t command,
              step_output_t *output);

#endif
