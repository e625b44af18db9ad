#include "app/step.h"

#include "core/fix.h"

static void take_battery(const step_config_t *config, mixer_state_t *mixer, const signals_state_t *signals)
{
    if (SIGNALS_HAVE(signals, SENSOR_BATTERY)) {
        if (config->battery_sags)
            mixer_correct(&config->mixer, mixer, signals->sensors.battery_mv);
        mixer->battery_mv = signals->sensors.battery_mv;
    } else if (mixer->battery_mv == 0) {
        mixer->battery_mv = config->battery_nominal_mv;
    }
}

static void estimate(const step_config_t *config, step_state_t *state, signals_state_t *signals)
{
    body_state_t *const model = &state->model;
    const signals_drive_t *const drive = &state->mixer.drive;
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

static void control(const step_config_t *config, step_state_t *state, step_output_t *out)
{
    const signals_demand_t *const demand = &state->mode.los.demand;
    pid_terms_t *terms = &out->speed;

    if (!demand->drive) {
        pid_stop(&state->speed_pid, terms);
        pid_stop(&state->heading_pid, &out->heading);
        return;
    }
    terms->error = fix_sub16(demand->speed_mm_s_q4, out->state.speed_mm_s_q4);
    terms->rate = out->state.accel_mm_s2;
    terms->feedforward_mv = fix_gain16_q10(config->feedforward_mv_q10, demand->speed_mm_s_q4);
    terms->saturated = state->mixer.drive.surge_saturated;
    terms->period_ms = out->state.sensors.period_ms;
    pid_step(&config->speed_pid, &state->speed_pid, terms);

    terms = &out->heading;
    terms->error = fix_angle_diff_bam16(demand->heading_bam16, out->state.heading_bam16);
    terms->rate = out->state.yaw_rate_mrad_s;
    terms->feedforward_mv = 0;
    terms->saturated = state->mixer.drive.yaw_saturated;
    terms->period_ms = out->state.sensors.period_ms;
    pid_step(&config->heading_pid, &state->heading_pid, terms);
}

void step_run(const step_config_t *config, const route_t *route, step_state_t *state, mode_command_t command,
              step_output_t *output)
{
    signals_state_t *const signals = &output->state;

    take_battery(config, &state->mixer, signals);
    estimate(config, state, signals);
    mode_step(&config->mode, route, &state->mode, signals, command);
    control(config, state, output);
    output->effort.surge_mv = output->speed.output_mv;
    output->effort.yaw_mv = output->heading.output_mv;
    mixer_step(&config->mixer, &state->mixer, &output->effort, signals);
}
