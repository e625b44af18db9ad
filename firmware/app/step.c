#include "app/step.h"

#include "core/bytes.h"
#include "core/fix.h"

/* Converts a voltage from mV to the model's unit, 2^MOTOR_VOLTAGE_BITS mV. */
static inline int16_t of_model(int16_t voltage_mv)
{
    return MOTOR_VOLTAGE_BITS == 0 ? voltage_mv : (int16_t)fix_trunc_shift(voltage_mv, MOTOR_VOLTAGE_BITS);
}

#ifndef FRICTION_UNLEARNT
/* Steps the model with the previous step's voltages minus the voltage that friction takes. */
static void predict(const step_config_t *config, step_state_t *state, const signals_drive_t *drive)
{
    const int16_t surge_mv = (int16_t)fix_trunc_shift(fix_add(drive->left_mv, drive->right_mv), 1);
    const int16_t taken_mv =
        friction_takes_mv(&config->speed.friction, &state->speed.friction, state->speed.speed_mm_s_q4, surge_mv);

    body_predict(config->model, &state->model, of_model(fix_sub16(drive->left_mv, taken_mv)),
                 of_model(fix_sub16(drive->right_mv, taken_mv)));
}

/* Returns the voltage that holds the demanded speed against friction. The autopilot never demands a negative speed. */
static int16_t feedforward_mv(const step_config_t *config, const step_state_t *state, int16_t speed_mm_s_q4)
{
    const int16_t mv = fix_mul16_q10(config->feedforward_mv_q10, speed_mm_s_q4);

    if (speed_mm_s_q4 == 0)
        return mv;
    return fix_add16(mv, friction_mv(&config->speed.friction, &state->speed.friction));
}
#else
static inline void predict(const step_config_t *config, step_state_t *state, const signals_drive_t *drive)
{
    body_predict(config->model, &state->model, of_model(drive->left_mv), of_model(drive->right_mv));
}

static inline int16_t feedforward_mv(const step_config_t *config, const step_state_t *state, int16_t speed_mm_s_q4)
{
    (void)state;
    return fix_mul16_q10(config->feedforward_mv_q10, speed_mm_s_q4);
}
#endif

void step_run(const step_config_t *config, const route_t *route, step_state_t *state, const signals_sensors_t *sensors,
              mode_command_t command, step_output_t *output)
{
    const signals_drive_t *const drive = &state->mixer.drive; /* output of the previous step */
    pid_input_t input;

    mixer_take_battery(&config->mixer, &state->mixer, sensors);

    /* The model, with the previous step's voltages. */
    state->lag_ms = (uint8_t)(state->lag_ms + sensors->period_ms);
    for (; state->lag_ms >= BODY_PERIOD_MS; state->lag_ms = (uint8_t)(state->lag_ms - BODY_PERIOD_MS))
        predict(config, state, drive);
    bytes_copy(&output->predicted.motion, &state->model.motion, sizeof output->predicted.motion);
    output->predicted.driven = drive->left_mv != 0 || drive->right_mv != 0;

    /* The estimator. */
    output->estimate.period_ms = sensors->period_ms;
    heading_step(&config->heading, &state->heading, sensors, &output->predicted, &output->estimate);
    body_correct_surge(config->model, &state->model,
                       speed_step(&config->speed, &state->speed, sensors, &output->predicted, &output->estimate));
    pose_step(&state->pose, sensors, &output->estimate);

    /* The monitor, with the previous step's voltages. */
#ifndef MONITOR_OFF
    monitor_step(config->monitor, &state->monitor, &output->estimate, drive, state->mixer.battery_mv);
#endif

    /* The autopilot. */
    mode_step(&config->mode, route, &state->mode, &output->estimate, command, &output->demand);

    /* The controllers. */
    if (!output->demand.drive) {
        pid_stop(&state->speed_pid, &output->speed_pid);
        pid_stop(&state->heading_pid, &output->heading_pid);
    } else {
        input.period_ms = output->estimate.period_ms;
        input.error = fix_sub16(output->demand.speed_mm_s_q4, output->estimate.speed_mm_s_q4);
        input.rate = output->estimate.accel_mm_s2;
        input.feedforward_mv = feedforward_mv(config, state, output->demand.speed_mm_s_q4);
        input.saturated = drive->surge_saturated;
        pid_step(&config->speed_pid, &state->speed_pid, &input, &output->speed_pid);

        input.error = fix_angle_diff_bam16(output->demand.heading_bam16, output->estimate.heading_bam16);
        input.rate = output->estimate.yaw_rate_mrad_s;
        input.feedforward_mv = 0;
        input.saturated = drive->yaw_saturated;
        pid_step(&config->heading_pid, &state->heading_pid, &input, &output->heading_pid);
    }
    output->effort.surge_mv = output->speed_pid.output_mv;
    output->effort.yaw_mv = output->heading_pid.output_mv;

    mixer_step(&config->mixer, &state->mixer, &output->effort, &output->estimate, &output->drive);
}
