#include "app/step.h"

#include "core/fix.h"

static int16_t round_q17_to_q4(int32_t value_q17)
{
    return fix_sat16(fix_round_shift(value_q17, 13));
}
static int16_t round_q12(int32_t value_q12)
{
    return fix_sat16(fix_round_shift(value_q12, 12));
}

/* The duty was made for the battery's last reading; this one says what the motors had. */
static void correct_drive(const step_config_t *config, step_state_t *state, uint16_t battery_mv)
{
    const uint16_t floor_mv = config->mixer.battery_floor_mv;
    const uint16_t believed_mv = state->battery_mv < floor_mv ? floor_mv : state->battery_mv;
    const int16_t change_mv = fix_sat16((int32_t)battery_mv - believed_mv);
    signals_drive_t *const drive = &state->drive;

    drive->left_mv = fix_sat16(drive->left_mv + fix_share_q15(change_mv, drive->left_q15));
    drive->right_mv = fix_sat16(drive->right_mv + fix_share_q15(change_mv, drive->right_q15));
}

static void estimate(const step_config_t *config, step_state_t *state, const signals_sensors_t *sensors,
                     signals_state_t *out)
{
    heading_input_t turned;
    heading_output_t heading;
    speed_input_t driven;
    speed_output_t speed;
    pose_input_t moved;
    pose_output_t pose;

    state->ahead_ms = (uint8_t)(state->ahead_ms + sensors->period_ms);
    for (; state->ahead_ms >= BODY_PERIOD_MS; state->ahead_ms = (uint8_t)(state->ahead_ms - BODY_PERIOD_MS))
        body_predict(config->model, &state->model, state->drive.left_mv, state->drive.right_mv);

    turned.sensors = sensors;
    turned.predicted_speed_mm_s_q4 = round_q17_to_q4(state->model.surge_mm_s_q17);
    turned.predicted_yaw_rate_mrad_s = round_q12(state->model.yaw_rate_mrad_s_q12);
    turned.driven = state->drive.left_mv != 0 || state->drive.right_mv != 0;
    heading_step(&config->heading, &state->heading, &turned, &heading);

    driven.sensors = sensors;
    driven.predicted_mm_s_q17 = state->model.surge_mm_s_q17;
    driven.predicted_sway_mm_s_q17 = state->model.sway_mm_s_q17;
    driven.yaw_rate_mrad_s = heading.yaw_rate_mrad_s;
    driven.at_rest = heading.at_rest;
    speed_step(&config->speed, &state->speed, &driven, &speed);
    body_correct_surge(config->model, &state->model, speed.correction_mm_s_q17);

    moved.sensors = sensors;
    moved.heading_bam16 = heading.heading_bam16;
    moved.travel_um_q5 = speed.travel_um_q5;
    moved.sway_travel_um_q5 = speed.sway_travel_um_q5;
    pose_step(&state->pose, &moved, &pose);

    out->x_um = pose.x_um;
    out->y_um = pose.y_um;
    out->heading_bam16 = heading.heading_bam16;
    out->speed_mm_s_q4 = speed.speed_mm_s_q4;
    out->yaw_rate_mrad_s = heading.yaw_rate_mrad_s;
    out->accel_mm_s2 = speed.accel_mm_s2;
    out->at_rest = heading.at_rest;
    out->valid = heading.valid;
}

static void no_output(pid_output_t *output)
{
    output->output_mv = output->proportional_mv = output->integral_mv = output->derivative_mv = 0;
    output->limited = 0;
}

static int16_t feedforward(const step_config_t *config, int16_t speed_mm_s_q4)
{
    return fix_sat16(fix_round_shift(fix_mul(config->feedforward_mv_q10, speed_mm_s_q4), 10));
}

static void control_speed(const step_config_t *config, step_state_t *state, uint8_t period_ms, step_output_t *out)
{
    const signals_demand_t *demand = &state->mode.demand;
    pid_input_t input;

    if (!demand->drive) {
        pid_stop(&state->speed_pid);
        no_output(&out->speed);
        return;
    }
    input.error = fix_sub16(demand->speed_mm_s_q4, out->state.speed_mm_s_q4);
    input.rate = out->state.accel_mm_s2;
    input.feedforward_mv = feedforward(config, demand->speed_mm_s_q4);
    input.saturated = state->drive.surge_saturated;
    input.period_ms = period_ms;
    pid_step(&config->speed_pid, &state->speed_pid, &input, &out->speed);
}

static void control_heading(const step_config_t *config, step_state_t *state, uint8_t period_ms, step_output_t *out)
{
    const signals_demand_t *demand = &state->mode.demand;
    pid_input_t input;

    if (!demand->drive) {
        pid_stop(&state->heading_pid);
        no_output(&out->heading);
        return;
    }
    input.error = fix_angle_diff_bam16(demand->heading_bam16, out->state.heading_bam16);
    input.rate = out->state.yaw_rate_mrad_s;
    input.feedforward_mv = 0;
    input.saturated = state->drive.yaw_saturated;
    input.period_ms = period_ms;
    pid_step(&config->heading_pid, &state->heading_pid, &input, &out->heading);
}

void step_run(const step_config_t *config, const route_t *route, step_state_t *state, const signals_sensors_t *sensors,
              mode_command_t command, step_output_t *output)
{
    if (config->battery_sags && (sensors->have & SENSOR_BATTERY))
        correct_drive(config, state, sensors->battery_mv);
    if (sensors->have & SENSOR_BATTERY)
        state->battery_mv = sensors->battery_mv;
    else if (state->battery_mv == 0)
        state->battery_mv = config->battery_nominal_mv;

    estimate(config, state, sensors, &output->state);
    mode_step(&config->mode, route, &state->mode, &output->state, command, sensors->period_ms);
    control_speed(config, state, sensors->period_ms, output);
    control_heading(config, state, sensors->period_ms, output);
    output->effort.surge_mv = output->speed.output_mv;
    output->effort.yaw_mv = output->heading.output_mv;
    mixer_step(&config->mixer, &state->mixer, &output->effort, &output->state, state->battery_mv, &state->drive);
}
