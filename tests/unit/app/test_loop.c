#include <string.h>

#include "app/loop.h"
#include "app/params_gen.h"
#include "app/telemetry.h"
#include "sil/sil.h"
#include "unity.h"
#include "wire/codecs_gen.h"

static const route_waypoint_t AHEAD[] = {{1000, 0}};
static sil_port_t port;
static loop_state_t state;
static loop_config_t config;
static route_t route;

void setUp(void)
{
    port = (sil_port_t){.imu_status = HAL_ABSENT, .rotation_status = HAL_ABSENT, .battery_mv = 9000};
    memset(&state, 0, sizeof state);
    config = PARAMS_COUPLED;
    route_set(&route, AHEAD, 1);
    sil_bind(&port);
    loop_start(&state);
}
void tearDown(void)
{
    sil_bind(NULL);
}

static void all_sensors(hal_status_t status)
{
    port.imu_status = port.rotation_status = port.reference_status = port.battery_status = status;
}

/* `ticks` ticks, each `period_ms` after the one before, the first of them with `command`. */
static void run(int ticks, uint32_t period_ms, mode_command_t command)
{
    for (int i = 0; i < ticks; i++) {
        loop_tick(&config, &route, &state, i == 0 ? command : MODE_NONE);
        port.clock_ms += period_ms;
        port.link_out_size = 0;
    }
}

static void test_loop_stops_the_motors_before_anything_else(void)
{
    port.left_q15 = 5;
    loop_start(&state);
    TEST_ASSERT_EQUAL_INT16(0, port.left_q15);
}

static void test_loop_keeps_the_motors_off_until_started(void)
{
    run(100, 3, MODE_NONE);
    TEST_ASSERT_EQUAL_UINT32(101, port.motor_writes);
    TEST_ASSERT_EQUAL_INT16(0, port.left_q15);
}

static void test_loop_drives_towards_a_waypoint_ahead(void)
{
    run(200, 3, MODE_START);
    TEST_ASSERT_GREATER_THAN_INT16(1000, port.left_q15);
    TEST_ASSERT_EQUAL_INT16(port.left_q15, port.right_q15);
    TEST_ASSERT_EQUAL_UINT16(0, state.late_ticks);
}

static void test_loop_counts_late_ticks_and_drives_on(void)
{
    run(10, 3, MODE_START);
    run(5, 6, MODE_NONE);
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL_UINT16(5, state.late_ticks);
    TEST_ASSERT_EQUAL(MODE_RUN, state.step.mode.mode);
}

static void test_loop_believes_the_same_way_at_any_period(void)
{
    int32_t on_time_um = 0;
    for (uint32_t period_ms = 3; period_ms <= 18; period_ms += 5) { /* 3, 8, 13, 18 */
        setUp();
        port.imu_status = HAL_OK;                        /* alone: the speed is the model's, */
        config.step.speed.friction.mv_per_mm_s2_q10 = 0; /* which this IMU at rest would teach a friction */
        port.reference_status = HAL_ABSENT;
        run(200, 3, MODE_NONE);
        run((int)(1440 / period_ms), period_ms, MODE_START);
        if (period_ms == 3)
            on_time_um = state.output.estimate.x_um;
        TEST_ASSERT_INT32_WITHIN(20000, on_time_um, state.output.estimate.x_um);
    }
    TEST_ASSERT_GREATER_THAN_INT32(100000, on_time_um);
}

static void test_loop_aborts_when_the_watchdog_was_not_served(void)
{
    run(200, 3, MODE_START);
    port.clock_ms += config.watchdog_ms;
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL(MODE_FAULT, state.step.mode.mode);
    TEST_ASSERT_EQUAL(MODE_LATE, state.step.mode.fault);
    TEST_ASSERT_EQUAL_UINT16(1, state.aborted);
    TEST_ASSERT_EQUAL_INT16(0, port.left_q15);
}

/* The mode after a run in which one tick came `period_ms` after the one before. */
static mode_name_t mode_after_ms(uint16_t watchdog_ms, uint32_t period_ms)
{
    setUp();
    config.watchdog_ms = watchdog_ms;
    run(20, 3, MODE_START);
    port.clock_ms += period_ms - 3;
    run(1, 3, MODE_NONE);
    return state.step.mode.mode;
}

static void test_loop_survives_the_watchdogs_time_and_no_more(void)
{
    TEST_ASSERT_EQUAL(MODE_RUN, mode_after_ms(12, 12));
    TEST_ASSERT_EQUAL(MODE_FAULT, mode_after_ms(12, 13));
}

static void test_loop_cuts_what_it_cannot_integrate_whatever_the_watchdog_allows(void)
{
    TEST_ASSERT_EQUAL(MODE_RUN, mode_after_ms(100, 20));
    TEST_ASSERT_EQUAL(20, state.sensors.period_ms);
    TEST_ASSERT_EQUAL(MODE_FAULT, mode_after_ms(100, 21));
    TEST_ASSERT_EQUAL(MODE_LATE, state.step.mode.fault);
    TEST_ASSERT_EQUAL_INT16(0, port.left_q15);
}

static void test_loop_takes_a_stall_of_more_than_16_bits_for_one(void)
{
    TEST_ASSERT_EQUAL(MODE_FAULT, mode_after_ms(20, 65536 + 4));
    TEST_ASSERT_EQUAL(20, state.sensors.period_ms);
    TEST_ASSERT_EQUAL_UINT16(1, state.late_ticks);
    TEST_ASSERT_EQUAL(MODE_FAULT, mode_after_ms(20, 131072 + 4));
    TEST_ASSERT_EQUAL(MODE_FAULT, mode_after_ms(20, 65535));
    TEST_ASSERT_EQUAL(MODE_FAULT, mode_after_ms(20, 65536));
}

static void test_loop_is_silent_for_as_much_of_a_stall_as_16_bits_hold(void)
{
    run(20, 3, MODE_NONE);
    all_sensors(HAL_STALE);
    port.clock_ms += 70000;
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL_UINT16(65535, state.silent_ms);
}

static void test_loop_counts_time_from_its_start(void)
{
    port.clock_ms += 3; /* loop_start() is a period before the first tick that is on time */
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL_UINT16(1, state.late_ticks);
    TEST_ASSERT_EQUAL(2 * STEP_MS, state.sensors.period_ms);
}

static void test_loop_integrates_at_least_a_millisecond(void)
{
    TEST_ASSERT_EQUAL(MODE_RUN, mode_after_ms(20, 0));
    TEST_ASSERT_EQUAL(1, state.sensors.period_ms);
}

static void test_loop_survives_a_clock_that_wraps(void)
{
    port.clock_ms = UINT32_MAX - 3U;
    loop_start(&state);
    run(20, 3, MODE_START);
    TEST_ASSERT_EQUAL(MODE_RUN, state.step.mode.mode);
    TEST_ASSERT_EQUAL_UINT16(0, state.late_ticks);
}

static void test_loop_stops_when_every_sensor_falls_silent(void)
{
    run(200, 3, MODE_START);
    port.reference_status = HAL_STALE;
    run(1 + (config.step.heading.blind_ms + config.step.mode.lost_ms) / 3 + 2, 3, MODE_NONE);
    TEST_ASSERT_EQUAL(MODE_FAULT, state.step.mode.mode);
    TEST_ASSERT_EQUAL(MODE_STATE_LOST, state.step.mode.fault);
    TEST_ASSERT_EQUAL_INT16(0, port.left_q15);
}

static void test_loop_takes_gyro_accelerometer_and_rotation_sensors(void)
{
    port.imu_status = port.rotation_status = HAL_OK;
    port.reference_status = port.battery_status = HAL_ABSENT;
    run(300, 3, MODE_NONE);
    TEST_ASSERT_TRUE(state.output.estimate.at_rest);
    TEST_ASSERT_EQUAL_UINT16(config.step.mixer.battery_nominal_mv, state.step.mixer.battery_mv);
    for (int i = 0; i < 167; i++) { /* a hand that turns the robot is not steady */
        port.imu.yaw_rate_mrad_s = 800;
        run(1, 3, MODE_NONE);
        port.imu.yaw_rate_mrad_s = 1200;
        run(1, 3, MODE_NONE);
    }
    TEST_ASSERT_INT16_WITHIN(40, 10451, (int16_t)state.output.estimate.heading_bam16); /* 1.002 rad */
}

static void test_loop_takes_a_gyro_without_an_accelerometer(void)
{
    port.imu_status = HAL_PARTLY;
    port.rotation_status = HAL_OK;
    port.reference_status = HAL_ABSENT;
    port.imu.accel_surge_mm_s2 = 5000;
    port.imu.yaw_rate_mrad_s = 700;
    run(100, 3, MODE_NONE);
    TEST_ASSERT_INT16_WITHIN(128, 700,
                             state.output.estimate.yaw_rate_mrad_s); /* what is steady counts as bias, up to 127 */
    TEST_ASSERT_EQUAL_INT32(0, state.step.speed.speed_mm_s_q17);
}

static void test_loop_sends_telemetry_every_so_many_ticks_and_a_heartbeat_every_hundred(void)
{
    int telemetry = 0, heartbeats = 0, reports = 0, of_a_tick;
    config.telemetry_every = 10;
    for (int i = 0; i < 400; i++) {
        port.link_out_size = 0;
        loop_tick(&config, &route, &state, MODE_NONE);
        port.clock_ms += 3;
        of_a_tick = 0;
        for (int k = 0; k < port.link_out_size; k++)
            if (port.link_out[k].id == WIRE_HEARTBEAT_FRAME_ID)
                TEST_ASSERT_EQUAL_INT(100 * heartbeats++, i);
            else if (port.link_out[k].id == WIRE_MONITOR_LEFT_FRAME_ID + (uint32_t)reports % MONITOR_CHANNELS)
                TEST_ASSERT_EQUAL_INT(100 * reports++ + 8, i);
            else
                of_a_tick++;
        TEST_ASSERT_LESS_OR_EQUAL_INT(1, of_a_tick); /* the link is not flooded */
        telemetry += of_a_tick;
    }
    TEST_ASSERT_EQUAL_UINT32(400, state.tick);
    TEST_ASSERT_EQUAL_INT(40 * TELEMETRY_PARTS, telemetry);
    TEST_ASSERT_EQUAL_INT(4, heartbeats);
    TEST_ASSERT_EQUAL_INT(4, reports);
    config.telemetry_every = 0;
    run(1, 3, MODE_NONE);
    loop_tick(&config, &route, &state, MODE_NONE);
    TEST_ASSERT_EQUAL_UINT16(0, port.link_out_size);
}

static void test_loop_cuts_a_run_in_silence_and_only_a_reset_leads_out(void)
{
    run(200, 3, MODE_START);
    all_sensors(HAL_STALE);
    run(config.silent_ms / 3, 3, MODE_NONE);
    TEST_ASSERT_EQUAL(MODE_RUN, state.step.mode.mode);
    TEST_ASSERT_NOT_EQUAL(0, port.left_q15);
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL(MODE_FAULT, state.step.mode.mode);
    TEST_ASSERT_EQUAL(MODE_SILENT, state.step.mode.fault);
    TEST_ASSERT_EQUAL_INT16(0, port.left_q15);
    TEST_ASSERT_EQUAL_UINT16(1, state.aborted);
    all_sensors(HAL_OK);
    run(10, 3, MODE_START);
    TEST_ASSERT_EQUAL(MODE_FAULT, state.step.mode.mode);
    run(2, 3, MODE_RESET);
    run(50, 3, MODE_START);
    TEST_ASSERT_EQUAL(MODE_RUN, state.step.mode.mode);
}

static void test_loop_is_silent_only_beyond_the_time_allowed(void)
{
    config.silent_ms = 99;
    run(200, 3, MODE_START);
    all_sensors(HAL_STALE);
    run(33, 3, MODE_NONE);
    TEST_ASSERT_EQUAL_UINT16(99, state.silent_ms);
    TEST_ASSERT_EQUAL(MODE_RUN, state.step.mode.mode);
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL(MODE_SILENT, state.step.mode.fault);
}

static void test_loop_takes_a_message_for_a_sign_of_life(void)
{
    run(200, 3, MODE_START);
    all_sensors(HAL_STALE);
    for (int i = 0; i < 2 * config.silent_ms / 3; i++) {
        if (i % 20 == 0)
            loop_heard(&state);
        run(1, 3, MODE_NONE);
    }
    TEST_ASSERT_EQUAL_UINT16(0, state.aborted);
}

static void test_loop_begins_at_its_first_tick_where_nobody_started_it(void)
{
    memset(&state, 0, sizeof state);
    port.clock_ms = 500000;
    run(1, 3, MODE_START);
    TEST_ASSERT_EQUAL(MODE_RUN, state.step.mode.mode);
    TEST_ASSERT_EQUAL_UINT16(0, state.late_ticks);
    TEST_ASSERT_EQUAL(STEP_MS, state.sensors.period_ms);
}

/* Current of the model's motors after a step in which the battery turns out to give `battery_mv`. */
static int32_t current_ua_q7(bool sags, uint16_t battery_mv)
{
    setUp();
    config.step.mixer.battery_sags = sags;
    run(200, 3, MODE_START);
    port.battery_mv = battery_mv;
    run(1, 3, MODE_NONE);
    return state.step.model.motor[0].current_ua_q7;
}

static void test_loop_tells_the_model_what_a_sagging_battery_gave(void)
{
    const int32_t full = current_ua_q7(true, 9000);
    const int32_t sagged = current_ua_q7(true, 8000);
    setUp();
    run(200, 3, MODE_START);
    state.step.mixer.drive.left_mv = (int16_t)(state.step.mixer.drive.left_mv - state.step.mixer.drive.left_mv / 9);
    state.step.mixer.drive.right_mv = (int16_t)(state.step.mixer.drive.right_mv - state.step.mixer.drive.right_mv / 9);
    run(1, 3, MODE_NONE);
    TEST_ASSERT_LESS_THAN_INT32(full - full / 50, sagged);
    TEST_ASSERT_INT32_WITHIN(full / 1000, state.step.model.motor[0].current_ua_q7, sagged);
    TEST_ASSERT_EQUAL_INT32(full, current_ua_q7(false, 9000));
    TEST_ASSERT_EQUAL_INT32(full, current_ua_q7(false, 8000));
}

static void test_loop_tells_the_model_what_a_battery_below_its_floor_gave(void)
{
    setUp();
    config.step.mixer.battery_sags = true;
    port.battery_mv = 2500; /* counts as 5 V: the duty gives half of what is wanted */
    run(1, 3, MODE_START);
    const int16_t wanted_mv = state.step.mixer.drive.left_mv;
    const int32_t rest = state.step.model.motor[0].current_ua_q7;
    run(1, 3, MODE_NONE);
    body_state_t half = {.x_um = 0};
    body_step(config.step.model, &half, wanted_mv / 2, wanted_mv / 2);
    TEST_ASSERT_EQUAL_INT32(0, rest);
    TEST_ASSERT_INT32_WITHIN(half.motor[0].current_ua_q7 / 1000, half.motor[0].current_ua_q7,
                             state.step.model.motor[0].current_ua_q7);
}

static void test_loop_counters_do_not_wrap(void)
{
    state.late_ticks = state.aborted = 65535;
    run(3, 9, MODE_START);
    port.clock_ms += 100;
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL(MODE_FAULT, state.step.mode.mode);
    TEST_ASSERT_EQUAL_UINT16(65535, state.late_ticks);
    TEST_ASSERT_EQUAL_UINT16(65535, state.aborted);
    all_sensors(HAL_STALE);
    state.silent_ms = 65530;
    run(3, 3, MODE_NONE);
    TEST_ASSERT_EQUAL_UINT16(65535, state.silent_ms);
}

static void only_the_gyro(void)
{
    all_sensors(HAL_ABSENT);
    port.imu_status = HAL_OK;
    port.imu.yaw_rate_mrad_s = 20;
}

static void test_loop_rests_before_a_run_until_the_gyros_bias_is_learnt(void)
{
    int steps = 0;
    only_the_gyro();
    run(1, 3, MODE_START);
    while (port.left_q15 == 0 && ++steps < 1000) {
        TEST_ASSERT_EQUAL(MODE_RUN, state.step.mode.mode);
        TEST_ASSERT_TRUE(state.output.estimate.bias_unknown);
        port.imu_status = steps % 2 ? HAL_STALE : HAL_OK; /* a starved link: every other sample is missing */
        run(1, 3, MODE_NONE);
    }
    TEST_ASSERT_INT_WITHIN(2, 2 * HEADING_BLOCK_STEPS, steps);
    TEST_ASSERT_FALSE(state.output.estimate.bias_unknown);
    TEST_ASSERT_EQUAL_INT32(20 * 256, state.step.heading.bias.value);
}

static void test_loop_hands_every_reading_on(void)
{
    all_sensors(HAL_OK);
    port.imu = (hal_imu_t){.accel_surge_mm_s2 = 11, .accel_sway_mm_s2 = 12, .yaw_rate_mrad_s = 13};
    port.rotation = (hal_rotation_t){.left = 14, .right = 15};
    port.reference =
        (hal_reference_t){.x_um = 16, .y_um = 17, .heading_bam16 = 18, .speed_mm_s_q4 = 19, .yaw_rate_mrad_s = 20};
    port.battery_mv = 8765;
    run(1, 3, MODE_NONE);
    TEST_ASSERT_EQUAL_INT16(11, state.sensors.accel_surge_mm_s2);
    TEST_ASSERT_EQUAL_INT16(12, state.sensors.accel_sway_mm_s2);
    TEST_ASSERT_EQUAL_INT16(13, state.sensors.yaw_rate_mrad_s);
    TEST_ASSERT_EQUAL_UINT16(14, state.sensors.rotation_left);
    TEST_ASSERT_EQUAL_UINT16(15, state.sensors.rotation_right);
    TEST_ASSERT_EQUAL_INT32(16, state.sensors.reference_x_um);
    TEST_ASSERT_EQUAL_INT32(17, state.sensors.reference_y_um);
    TEST_ASSERT_EQUAL_UINT16(18, state.sensors.reference_heading_bam16);
    TEST_ASSERT_EQUAL_INT16(19, state.sensors.reference_speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT16(20, state.sensors.reference_yaw_rate_mrad_s);
    TEST_ASSERT_EQUAL_UINT16(8765, state.sensors.battery_mv);
    TEST_ASSERT_EQUAL_HEX8(SENSOR_GYRO | SENSOR_ACCELEROMETER | SENSOR_ROTATION | SENSOR_REFERENCE | SENSOR_BATTERY,
                           state.sensors.have);
}

static void test_loop_sends_a_whole_report_in_as_many_ticks_as_it_has(void)
{
    for (int every = 1; every <= 3; every++) {
        int sent = 0;
        config.telemetry_every = (uint8_t)every;
        setUp();
        config.telemetry_every = (uint8_t)every;
        run(1, 3, MODE_NONE); /* with a heartbeat, and the first part or parts */
        state.until_telemetry = 0;
        for (int tick = 0; tick < every; tick++) {
            port.link_out_size = 0;
            loop_tick(&config, &route, &state, MODE_NONE);
            port.clock_ms += 3;
            sent += port.link_out_size;
            TEST_ASSERT_LESS_OR_EQUAL_INT((TELEMETRY_PARTS + every - 1) / every, port.link_out_size);
        }
        TEST_ASSERT_EQUAL_INT(TELEMETRY_PARTS, sent);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_loop_stops_the_motors_before_anything_else);
    RUN_TEST(test_loop_keeps_the_motors_off_until_started);
    RUN_TEST(test_loop_drives_towards_a_waypoint_ahead);
    RUN_TEST(test_loop_counts_late_ticks_and_drives_on);
    RUN_TEST(test_loop_believes_the_same_way_at_any_period);
    RUN_TEST(test_loop_aborts_when_the_watchdog_was_not_served);
    RUN_TEST(test_loop_survives_the_watchdogs_time_and_no_more);
    RUN_TEST(test_loop_cuts_what_it_cannot_integrate_whatever_the_watchdog_allows);
    RUN_TEST(test_loop_takes_a_stall_of_more_than_16_bits_for_one);
    RUN_TEST(test_loop_is_silent_for_as_much_of_a_stall_as_16_bits_hold);
    RUN_TEST(test_loop_counts_time_from_its_start);
    RUN_TEST(test_loop_integrates_at_least_a_millisecond);
    RUN_TEST(test_loop_survives_a_clock_that_wraps);
    RUN_TEST(test_loop_stops_when_every_sensor_falls_silent);
    RUN_TEST(test_loop_takes_gyro_accelerometer_and_rotation_sensors);
    RUN_TEST(test_loop_takes_a_gyro_without_an_accelerometer);
    RUN_TEST(test_loop_sends_telemetry_every_so_many_ticks_and_a_heartbeat_every_hundred);
    RUN_TEST(test_loop_cuts_a_run_in_silence_and_only_a_reset_leads_out);
    RUN_TEST(test_loop_is_silent_only_beyond_the_time_allowed);
    RUN_TEST(test_loop_takes_a_message_for_a_sign_of_life);
    RUN_TEST(test_loop_begins_at_its_first_tick_where_nobody_started_it);
    RUN_TEST(test_loop_tells_the_model_what_a_sagging_battery_gave);
    RUN_TEST(test_loop_tells_the_model_what_a_battery_below_its_floor_gave);
    RUN_TEST(test_loop_counters_do_not_wrap);
    RUN_TEST(test_loop_rests_before_a_run_until_the_gyros_bias_is_learnt);
    RUN_TEST(test_loop_hands_every_reading_on);
    RUN_TEST(test_loop_sends_a_whole_report_in_as_many_ticks_as_it_has);
    return UNITY_END();
}
