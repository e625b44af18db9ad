#include "app/step.h"

#include "core/bytes.h"
#include "core/fix.h"

/* A voltage that was meant for another battery. */
static int16_t corrected_mv(int16_t voltage_mv, int16_t change_mv, int16_t duty_q15)
{
    return fix_add16(voltage_mv, (int16_t)fix_share_q15(change_mv, duty_q15));
}

/* The duty was made for the battery's last reading; this one says what the motors had. */
static void correct_drive(const step_config_t *config, step_state_t *state, uint16_t battery_mv)
{
    const uint16_t floor_mv = config->mixer.battery_floor_mv;
    const uint16_t believed_mv = state->battery_mv < floor_mv ? floor_mv : state->battery_mv;
    const int16_t change_mv = (int16_t)(battery_mv - believed_mv);
    signals_drive_t *const drive = &state->drive;

    drive->left_mv = corrected_mv(drive->left_mv, change_mv, drive->left_q15);
    drive->right_mv = corrected_mv(drive->right_mv, change_mv, drive->right_q15);
}

static void take_battery(const step_config_t *config, step_state_t *state, const signals_state_t *signals)
{
    if (SIGNALS_HAVE(signals, SENSOR_BATTERY)) {
        if (config->battery_sags)
            correct_drive(config, state, signals->sensors.battery_mv);
        state->battery_mv = signals->sensors.battery_mv;
    } else if (state->battery_mv == 0) {
        state->battery_mv = config->battery_nominal_mv;
    }
}

static void estimate(const step_config_t *config, step_state_t *state, signals_state_t *signals)
{
    body_state_t *const model = &state->model;
    const signals_drive_t *const drive = &state->drive;
    uint8_t ahead_ms = (uint8_t)(state->ahead_ms + signals->sensors.period_ms);

    for (; ahead_ms >= BODY_PERIOD_MS; ahead_ms = (uint8_t)(ahead_ms - BODY_PERIOD_MS))
        body_predict(config->model, model, drive->left_mv, drive->right_mv);
    state->ahead_ms = ahead_ms;
    signals->predicted = &model->motion;
    signals->driven = drive->left_mv != 0 || drive->right_mv != 0;

    heading_step(&config->heading, &state->heading, signals);
    body_correct_surge(config->model, model, speed_step(&config->speed, &state->speed, signals));
    pose_step(&state->pose, signals);
}

static int16_t feedforward(const step_config_t *config, int16_t speed_mm_s_q4)
{
    return fix_round16(fix_mul(config->feedforward_mv_q10, speed_mm_s_q4), 10);
}

static void hold(bool drive, const pid_config_t *config, pid_state_t *state, pid_terms_t *terms)
{
    if (drive) {
        pid_step(config, state, terms);
    } else {
        pid_stop(state);
        bytes_clear(terms, sizeof *terms);
    }
}

static void control(const step_config_t *config, step_state_t *state, step_output_t *out)
{
    const signals_demand_t *const demand = &state->mode.demand;
    const uint8_t period_ms = out->state.sensors.period_ms;
    pid_terms_t *terms = &out->speed;

    terms->error = fix_sub16(demand->speed_mm_s_q4, out->state.speed_mm_s_q4);
    terms->rate = out->state.accel_mm_s2;
    terms->feedforward_mv = feedforward(config, demand->speed_mm_s_q4);
    terms->saturated = state->drive.surge_saturated;
    terms->period_ms = period_ms;
    hold(demand->drive, &config->speed_pid, &state->speed_pid, terms);

    terms = &out->heading;
    terms->error = fix_angle_diff_bam16(demand->heading_bam16, out->state.heading_bam16);
    terms->rate = out->state.yaw_rate_mrad_s;
    terms->feedforward_mv = 0;
    terms->saturated = state->drive.yaw_saturated;
    terms->period_ms = period_ms;
    hold(demand->drive, &config->heading_pid, &state->heading_pid, terms);
}

void step_run(const step_config_t *config, const route_t *route, step_state_t *state, mode_command_t command,
              step_output_t *output)
{
    signals_state_t *const signals = &output->state;

    take_battery(config, state, signals);
    estimate(config, state, signals);
    mode_step(&config->mode, route, &state->mode, signals, command, signals->sensors.period_ms);
    control(config, state, output);
    output->effort.surge_mv = output->speed.output_mv;
    output->effort.yaw_mv = output->heading.output_mv;
    mixer_step(&config->mixer, &state->mixer, &output->effort, signals, state->battery_mv, &state->drive);
}
