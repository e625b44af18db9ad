#include "app/step.h"

#include "core/fix.h"

static void take_battery(const step_config_t *config, step_state_t *state, const signals_state_t *signals)
{
    if (SIGNALS_HAVE(signals, SENSOR_BATTERY)) {
        if (config->battery_sags)
            mixer_correct(&config->mixer, &state->mixer, signals->sensors.battery_mv);
        state->mixer.battery_mv = signals->sensors.battery_mv;
    } else if (state->mixer.battery_mv == 0) {
        state->mixer.battery_mv = config->battery_nominal_mv;
    }
}

static void estimate(const step_config_t *config, step_state_t *state, signals_state_t *signals)
{
    state->ahead_ms = (uint8_t)(state->ahead_ms + signals->sensors.period_ms);
    for (; state->ahead_ms >= BODY_PERIOD_MS; state->ahead_ms = (uint8_t)(state->ahead_ms - BODY_PERIOD_MS))
        body_predict(config->model, &state->model, state->mixer.drive.left_mv, state->mixer.drive.right_mv);
    signals->predicted = &state->model.motion;
    signals->driven = state->mixer.drive.left_mv != 0 || state->mixer.drive.right_mv != 0;

    heading_step(&config->heading, &state->heading, signals);
    body_correct_surge(config->model, &state->model, speed_step(&config->speed, &state->speed, signals));
    pose_step(&state->pose, signals);
}

static void control(const step_config_t *config, step_state_t *state, step_output_t *out)
{
    if (!state->mode.los.demand.drive) {
        pid_stop(&state->speed_pid, &out->speed);
        pid_stop(&state->heading_pid, &out->heading);
        return;
    }
    out->speed.error = fix_sub16(state->mode.los.demand.speed_mm_s_q4, out->state.speed_mm_s_q4);
    out->speed.rate = out->state.accel_mm_s2;
    out->speed.feedforward_mv = fix_gain16_q10(config->feedforward_mv_q10, state->mode.los.demand.speed_mm_s_q4);
    out->speed.saturated = state->mixer.drive.surge_saturated;
    out->speed.period_ms = out->state.sensors.period_ms;
    pid_step(&config->speed_pid, &state->speed_pid, &out->speed);

    out->heading.error = fix_angle_diff_bam16(state->mode.los.demand.heading_bam16, out->state.heading_bam16);
    out->heading.rate = out->state.yaw_rate_mrad_s;
    out->heading.feedforward_mv = 0;
    out->heading.saturated = state->mixer.drive.yaw_saturated;
    out->heading.period_ms = out->state.sensors.period_ms;
    pid_step(&config->heading_pid, &state->heading_pid, &out->heading);
}

void step_run(const step_config_t *config, const route_t *route, step_state_t *state, mode_command_t command,
              step_output_t *output)
{
    take_battery(config, state, &output->state);
    estimate(config, state, &output->state);
    mode_step(&config->mode, route, &state->mode, &output->state, command);
    control(config, state, output);
    output->effort.surge_mv = output->speed.output_mv;
    output->effort.yaw_mv = output->heading.output_mv;
    mixer_step(&config->mixer, &state->mixer, &output->effort, &output->state);
}
