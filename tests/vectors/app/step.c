#include "app/step.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 125 };

/* A run: a route, the constants or a robot of which something is known, and sensors that it has throughout. */
typedef struct {
    step_config_t config;
    route_t route;
    route_waypoint_t waypoints[DRAWN_WAYPOINTS];
    step_state_t state;
    signals_sensors_t sensors;
    uint8_t have;
    bool wild; /* the sensors say anything; else what a robot about its waypoint would */
} run_t;

static void begin(run_t *run, step_output_t *output)
{
    static const uint8_t fits[] = {SENSOR_REFERENCE | SENSOR_BATTERY,
                                   SENSOR_GYRO | SENSOR_ACCELEROMETER | SENSOR_BATTERY,
                                   SENSOR_GYRO | SENSOR_ACCELEROMETER | SENSOR_ROTATION | SENSOR_BATTERY, 31};

    bytes_copy_flash(&run->config, &PARAMS.step, sizeof run->config);
    if (draw_rarely(1)) {
        draw_drive_config(&run->config.mixer.drive);
        run->config.mixer.drive.reserve_mv = (int16_t)draw_up_to(4000);
        run->config.mixer.battery_sags = draw_rarely(1);
        run->config.heading.gyro_bias_mrad_s = draw_s16();
        run->config.heading.gyro_scale_q15 = draw_between(-32767, 32767);
        run->config.speed.count_mismatch_q15 = draw_between(-32767, 32767);
    }
    draw_route(&run->route, run->waypoints);
    bytes_clear(&run->state, sizeof run->state);
    bytes_clear(output, sizeof *output);
    run->have = fits[draw_u16() & 3U] & DRAWN_SENSORS;
    run->wild = draw_rarely(2);
}

static void sense(run_t *run)
{
    signals_sensors_t *const sensors = &run->sensors;
    signals_estimate_t motion;

    motion.x_um = sensors->reference_x_um;
    motion.y_um = sensors->reference_y_um;
    draw_sensors(sensors);
    if (!draw_rarely(3))
        sensors->have = run->have;
    if (run->wild)
        return;
    draw_estimate_about(&motion, &run->waypoints[run->state.mode.los.waypoint], run->state.mode.los.bearing_bam16);
    sensors->reference_x_um = motion.x_um;
    sensors->reference_y_um = motion.y_um;
    sensors->reference_heading_bam16 = motion.heading_bam16;
    sensors->reference_speed_mm_s_q4 = motion.speed_mm_s_q4;
    sensors->reference_yaw_rate_mrad_s = motion.yaw_rate_mrad_s;
    sensors->yaw_rate_mrad_s = (int16_t)(draw_u16() & 1023U) - 512;
    sensors->accel_surge_mm_s2 = (int16_t)(draw_u16() & 1023U) - 512;
    if (sensors->battery_mv < 6000)
        sensors->battery_mv = 9000;
}

static void hash(const step_state_t *state, const step_output_t *output)
{
    hash_s32(state->model.motion.surge_mm_s_q17);
    hash_s32(state->model.motion.sway_mm_s_q17);
    hash_s32(state->model.motion.yaw_rate_mrad_s_q12);
    hash_s32(state->speed.residual_um_q5);
    hash_u8((uint8_t)state->mode.mode);
    hash_u8((uint8_t)state->mode.fault);
    hash_demand(&output->demand);
    hash_s32(output->estimate.x_um);
    hash_s32(output->estimate.y_um);
    hash_u16(output->estimate.heading_bam16);
    hash_s16(output->estimate.speed_mm_s_q4);
    hash_s16(output->estimate.yaw_rate_mrad_s);
    hash_s16(output->estimate.accel_mm_s2);
    hash_u8(output->estimate.at_rest);
    hash_u8(output->estimate.valid);
    hash_pid_output(&output->speed_pid);
    hash_pid_output(&output->heading_pid);
    hash_s16(output->effort.surge_mv);
    hash_s16(output->effort.yaw_mv);
    hash_drive(&output->drive);
    hash_u8(state->lag_ms);
    hash_u16(state->mixer.battery_mv);
}

void vectors_feed(void)
{
    static run_t run;
    static step_output_t output;
    static uint8_t left;
    mode_command_t command = MODE_NONE;

    if (left == 0) {
        left = RUN_STEPS;
        begin(&run, &output);
    }
    left--;
    if (run.state.mode.mode != MODE_RUN)
        command = draw_rarely(1) ? MODE_START : MODE_RESET;
    if (draw_rarely(6))
        command = (mode_command_t)draw_up_to(MODE_CUT_LATE);
    sense(&run);
    step_run(&run.config, &run.route, &run.state, &run.sensors, command, &output);
    hash(&run.state, &output);
}
