/* The whole step from its stages: each stage is replaced by what was proved of it (its harness), and its assumptions are asserted where it is called. */
#include "contracts.h"
#include "app/step.c"

static step_config_t *config_of;
static const route_t *route_of;
static bool modelled;

void body_predict(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv,
                  int16_t right_mv) /* body.c: any voltages */
{
    body_state_t after;
    (void)coefficients, (void)left_mv, (void)right_mv;
    *state = after;
    modelled = true;
}

void body_correct_surge(const body_coefficients_t *coefficients, body_state_t *state,
                        int32_t change_mm_s_q17) /* body.c: any change */
{
    body_state_t after;
    (void)coefficients, (void)change_mm_s_q17;
    *state = after;
}

void heading_step(const heading_config_t *config, heading_state_t *state, const signals_sensors_t *sensors,
                  const signals_predicted_t *predicted, signals_estimate_t *estimate)
{
    heading_state_t after;
    signals_estimate_t any;
    (void)config, (void)predicted;
    ASSERT(sensors_hold(sensors) && heading_holds(state));
    ASSUME(heading_holds(&after));
    *state = after;
    any.period_ms = estimate->period_ms;
    *estimate = any;
}

int32_t speed_step(const speed_config_t *config, speed_state_t *state, const signals_sensors_t *sensors,
                   const signals_predicted_t *predicted, signals_estimate_t *estimate)
{
    speed_state_t after;
    signals_estimate_t any;
    int32_t correction;
    (void)config, (void)predicted;
    ASSERT(sensors_hold(sensors) && speed_holds(state) && estimate->period_ms == sensors->period_ms);
    ASSUME(speed_holds(&after) && estimate_holds(&any));
    ASSUME(any.valid == estimate->valid && any.at_rest == estimate->at_rest &&
           any.bias_unknown == estimate->bias_unknown);
    *state = after;
    *estimate = any;
    return correction;
}

int16_t friction_mv(const friction_config_t *config, const friction_state_t *state)
{
    int16_t friction;
    (void)config;
    ASSERT(friction_holds(state));
    ASSUME(friction >= 0 && friction <= FRICTION_MOST_MV);
    return friction;
}

int16_t friction_takes_mv(const friction_config_t *config, const friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t surge_mv)
{
    int16_t taken_mv;
    (void)config, (void)speed_mm_s_q4, (void)surge_mv;
    ASSERT(friction_holds(state));
    ASSUME(UP_TO(FRICTION_MOST_MV, taken_mv));
    return taken_mv;
}

void pose_step(pose_state_t *state, const signals_sensors_t *sensors, signals_estimate_t *estimate)
{
    pose_state_t after;
    int32_t x, y;
    ASSERT(sensors_hold(sensors) && pose_holds(state) && estimate_holds(estimate));
    ASSUME(pose_holds(&after));
    *state = after;
    estimate->x_um = x;
    estimate->y_um = y;
}

void monitor_step(const monitor_config_t *config, monitor_state_t *state, const signals_estimate_t *estimate,
                  const signals_drive_t *drive, uint16_t battery_mv) /* monitor.c: any estimate, voltages and reading */
{
    monitor_state_t after;
    (void)config, (void)drive, (void)battery_mv;
    ASSERT(monitor_holds(state) && WITHIN(signals_estimate_t_period_ms, estimate->period_ms));
    ASSUME(monitor_holds(&after));
    *state = after;
}

void mode_step(const mode_config_t *config, const route_t *route, mode_state_t *state,
               const signals_estimate_t *estimate, mode_command_t command, signals_demand_t *demand)
{
    mode_state_t after;
    (void)config, (void)command;
    ASSERT(route == route_of && mode_holds(state, route) && WITHIN(signals_estimate_t_period_ms, estimate->period_ms));
    ASSUME(mode_holds(&after, route));
    *state = after;
    *demand = after.demand;
}

void pid_step(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, pid_output_t *output)
{
    pid_state_t after;
    pid_output_t any;
    (void)input;
    ASSERT(pid_holds(state));
    ASSUME(pid_holds(&after) && UP_TO(config->limit_mv, any.output_mv));
    *state = after;
    *output = any;
}

void pid_stop(pid_state_t *state, pid_output_t *output)
{
    const pid_output_t off = {0};
    state->integral_mv_q16 = 0;
    *output = off;
}

void mixer_take_battery(const mixer_config_t *config, mixer_state_t *state, const signals_sensors_t *sensors)
{
    mixer_state_t after;
    (void)config, (void)sensors;
    ASSERT(mixer_holds(state));
    ASSUME(mixer_holds(&after));
    *state = after;
}

void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_estimate_t *estimate, signals_drive_t *drive)
{
    mixer_state_t after;
    (void)config, (void)estimate;
    ASSERT(effort_holds(effort));
    ASSUME(mixer_holds(&after) && after.battery_mv == state->battery_mv);
    ASSUME(effort->surge_mv != 0 || effort->yaw_mv != 0 ||
           (after.drive.left_q15 == 0 && after.drive.right_q15 == 0)); /* mixer_off */
    *state = after;
    *drive = after.drive;
}

static bool step_holds(const step_state_t *of, const route_t *route)
{
    return heading_holds(&of->heading) && speed_holds(&of->speed) && pose_holds(&of->pose) &&
           mode_holds(&of->mode, route) && pid_holds(&of->speed_pid) && pid_holds(&of->heading_pid) &&
           mixer_holds(&of->mixer) && monitor_holds(&of->monitor) && of->lag_ms < BODY_PERIOD_MS;
}

void step_keeps(void)
{
    parameters_t parameters;
    route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX];
    route_t route;
    step_state_t state;
    signals_sensors_t sensors;
    mode_command_t command;
    step_output_t output;

    route.waypoints = waypoints;
    route_of = &route;
    config_of = &parameters.config.step;
    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config) && route_holds(&route));
    ASSUME(step_holds(&state, &route) && sensors_hold(&sensors));
    step_run(config_of, &route, &state, &sensors, command, &output);
    ASSERT(step_holds(&state, &route));
    ASSERT(drive_holds(&output.drive));
    /* The motors are off in every mode but RUN. */
    ASSERT(state.mode.mode == MODE_RUN || (output.drive.left_q15 == 0 && output.drive.right_q15 == 0));
    ASSERT(output.demand.drive || (output.drive.left_q15 == 0 && output.drive.right_q15 == 0));
    END();
}

void step_begins(void) /* a state of zeros, at the start and after OPEN, with any route */
{
    const step_state_t zero = {0};
    route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX];
    route_t route;

    route.waypoints = waypoints;
    ASSUME(route_holds(&route));
    ASSERT(step_holds(&zero, &route));
    END();
}
