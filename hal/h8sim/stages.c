/* stages.c: one stage of the control step, ten times over, in the state that a few steps of a mission leave: what count has
 * the simulator count. -DSTAGE=NAME; `none` is the program without a stage, whose count is taken off. */
#include "app/params_gen.h"
#include "app/telemetry.h"

enum { WARM_UP = 5, ROUNDS = 10 };

#ifdef BODY_WITHOUT_COUPLED
static const step_config_t *const config = &PARAMS_PAPER.step;
#else
static const step_config_t *const config = &PARAMS_COUPLED.step;
#endif

static const route_waypoint_t waypoints[] = {{1000, 700}, {2000, -500}};
static route_t route;
static step_state_t state;
static step_output_t output;
static signals_sensors_t sensors;

static void none(void) {}
static void model(void)
{
    body_predict(&config->model, &state.model, state.drive.left_mv, state.drive.right_mv);
}
static void heading(void)
{
    static heading_output_t out;
    static heading_input_t input = {.sensors = &sensors, .predicted_speed_mm_s_q4 = 1234, .driven = true};
    heading_step(&config->heading, &state.heading, &input, &out);
}
static void speed(void)
{
    static speed_output_t out;
    static speed_input_t input = {.sensors = &sensors, .predicted_mm_s_q17 = 12345678L, .yaw_rate_mrad_s = 321};
    speed_step(&config->speed, &state.speed, &input, &out);
    body_correct_surge(&config->model, &state.model, out.correction_mm_s_q17);
}
static void pose(void)
{
    static pose_output_t out;
    static pose_input_t input = {.sensors = &sensors, .heading_bam16 = 4321, .travel_um_q5 = 43210L};
    pose_step(&state.pose, &input, &out);
}
static void guidance(void)
{
    mode_step(&config->mode, &route, &state.mode, &output.state, MODE_NONE, 3);
}
static void control(void)
{
    static const pid_input_t input = {.error = 1234, .rate = -321, .feedforward_mv = 2345, .period_ms = 3};
    pid_step(&config->speed_pid, &state.speed_pid, &input, &output.speed);
    pid_step(&config->heading_pid, &state.heading_pid, &input, &output.heading);
}
static void mixer(void)
{
    mixer_step(&config->mixer, &state.mixer, &output.effort, &output.state, 9000, &state.drive);
}
static void telemetry(void)
{
    static message_t message;
    for (uint8_t part = 0; part < TELEMETRY_PARTS; part++)
        telemetry_part(part, 1, &state, &output, &message);
}
static void step(void)
{
    step_run(config, &route, &state, &sensors, MODE_NONE, &output);
}

int main(void)
{
    static void (*const all[])(void) = {none, model, heading, speed, pose, guidance, control, mixer, telemetry, step};

    (void)all; /* the others are not left out: every count is of the same program but for its last loop */
    sensors.have = SENSOR_GYRO | SENSOR_ACCELEROMETER | SENSOR_ROTATION | SENSOR_BATTERY;
    sensors.period_ms = 3;
    sensors.battery_mv = 9000;
    sensors.accel_surge_mm_s2 = 1234;
    sensors.yaw_rate_mrad_s = 567;
    (void)route_set(&route, waypoints, 2);
    for (uint8_t i = 0; i < WARM_UP; i++)
        step_run(config, &route, &state, &sensors, i == 0 ? MODE_START : MODE_NONE, &output);
    for (uint8_t i = 0; i < ROUNDS; i++)
        STAGE();
    return state.mode.mode == MODE_RUN ? 0 : 1;
}
