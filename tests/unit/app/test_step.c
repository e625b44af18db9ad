#include "app/params_gen.h"
#include "app/step.h"
#include "unity.h"

static step_config_t config;
static step_state_t state;
static signals_sensors_t sensors;
static step_output_t output;
static const route_t NOWHERE = {0};

void setUp(void)
{
    config = PARAMS_COUPLED.step;
    state = (step_state_t){.mixer = {.battery_mv = 9000}};
    sensors = (signals_sensors_t){.have = SENSOR_GYRO, .period_ms = BODY_PERIOD_MS};
}
void tearDown(void) {}

/* Whether the estimator is told that motors with these voltages drive. */
static bool driven_with(int16_t left_mv, int16_t right_mv)
{
    state.mixer.drive.left_mv = left_mv;
    state.mixer.drive.right_mv = right_mv;
    step_run(&config, &NOWHERE, &state, &sensors, MODE_NONE, &output);
    return output.predicted.driven;
}

static void test_step_is_driven_where_one_motor_is(void)
{
    TEST_ASSERT_TRUE(driven_with(1, 0));
    TEST_ASSERT_TRUE(driven_with(0, 1));
    TEST_ASSERT_TRUE(driven_with(-1, 0));
    TEST_ASSERT_TRUE(driven_with(0, -1));
    TEST_ASSERT_TRUE(driven_with(5, -5));
    TEST_ASSERT_FALSE(driven_with(0, 0));
}

static void test_step_learns_no_bias_while_one_motor_drives(void)
{
    for (int i = 0; i < 2 * HEADING_BLOCK_STEPS; i++)
        (void)driven_with(1, 0);
    TEST_ASSERT_EQUAL_UINT16(0, state.heading.bias.learnt);
    for (int i = 0; i < 2 * HEADING_BLOCK_STEPS; i++)
        (void)driven_with(0, 0);
    TEST_ASSERT_EQUAL_UINT16(2, state.heading.bias.learnt);
}

static void test_step_moves_the_model_by_whole_periods(void)
{
    sensors.period_ms = BODY_PERIOD_MS - 1;
    (void)driven_with(4500, 4500);
    TEST_ASSERT_EQUAL_INT32(0, state.model.motor[0].current_ua_q7);
    sensors.period_ms = 1;
    (void)driven_with(4500, 4500);
    const int32_t once = state.model.motor[0].current_ua_q7;
    TEST_ASSERT_GREATER_THAN_INT32(0, once);
    TEST_ASSERT_EQUAL_UINT8(0, state.lag_ms);
    setUp();
    (void)driven_with(4500, 4500);
    TEST_ASSERT_EQUAL_INT32(once, state.model.motor[0].current_ua_q7);
}

/* A step in RUN towards a waypoint ahead, with a reference that says 100 mm/s and 200 mrad/s. */
static void drive_ahead(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    static route_t route;

    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, AHEAD, 1));
    sensors.have = SENSOR_REFERENCE;
    sensors.reference_speed_mm_s_q4 = 1600;
    sensors.reference_yaw_rate_mrad_s = 200;
    sensors.reference_heading_bam16 = 65536 - 500; /* the waypoint is to the right */
    step_run(&config, &route, &state, &sensors, MODE_START, &output);
    TEST_ASSERT_TRUE(output.demand.drive);
}

/* The voltage of surge towards a waypoint ahead, and the model's speed in the step after it. */
static int16_t surge_ahead_mv(int32_t friction_mv, int32_t *speed_mm_s_q17)
{
    setUp();
    config.mode.los.cruise_mm_s_q4 = 3200;
    state.speed.friction.learnt_mv_q4 = (uint16_t)(friction_mv * 16);
    drive_ahead();
    const int16_t surge_mv = output.effort.surge_mv;
    drive_ahead();
    *speed_mm_s_q17 = output.predicted.motion.surge_mm_s_q17;
    return surge_mv;
}

static void test_step_adds_friction_to_the_motors_and_takes_it_from_the_model(void)
{
    int32_t without, with;
    const int16_t needed_mv = surge_ahead_mv(0, &without);
    TEST_ASSERT_INT16_WITHIN(2, 500, surge_ahead_mv(500, &with) - needed_mv);
    TEST_ASSERT_INT32_WITHIN(200, without, with);
}

static void test_step_damps_the_controllers_by_what_is_measured(void)
{
    config.speed_pid = config.heading_pid = (pid_config_t){.kd_mv_q10 = 1024, .limit_mv = 32000};
    config.feedforward_mv_q10 = 0;
    drive_ahead();
    TEST_ASSERT_NOT_EQUAL(0, output.estimate.accel_mm_s2);
    TEST_ASSERT_EQUAL_INT16(-output.estimate.accel_mm_s2, output.effort.surge_mv);
    TEST_ASSERT_EQUAL_INT16(-200, output.effort.yaw_mv);
}

/* What each controller has summed up after a step in which the mixer has just given less surge or yaw than it was asked. */
static void integrals(int8_t surge, int8_t yaw, int32_t *speed, int32_t *heading)
{
    setUp();
    config.speed_pid = config.heading_pid = (pid_config_t){.ki_mv_q10 = 5000, .limit_mv = 32000};
    state.mixer.drive.surge_saturated = surge;
    state.mixer.drive.yaw_saturated = yaw;
    drive_ahead();
    *speed = state.speed_pid.integral_mv_q16;
    *heading = state.heading_pid.integral_mv_q16;
}

static void test_step_holds_the_integral_whose_effort_the_mixer_cuts(void)
{
    int32_t speed, heading;
    integrals(0, 0, &speed, &heading);
    TEST_ASSERT_GREATER_THAN_INT32(0, speed);
    TEST_ASSERT_GREATER_THAN_INT32(0, heading);
    integrals(1, 0, &speed, &heading);
    TEST_ASSERT_EQUAL_INT32(0, speed);
    TEST_ASSERT_GREATER_THAN_INT32(0, heading);
    integrals(0, 1, &speed, &heading);
    TEST_ASSERT_GREATER_THAN_INT32(0, speed);
    TEST_ASSERT_EQUAL_INT32(0, heading);
}

static void test_step_empties_both_controllers_where_the_robot_may_not_drive(void)
{
    state.speed_pid.integral_mv_q16 = state.heading_pid.integral_mv_q16 = 1000L * 65536;
    TEST_ASSERT_FALSE(driven_with(0, 0));
    TEST_ASSERT_EQUAL_INT32(0, state.speed_pid.integral_mv_q16);
    TEST_ASSERT_EQUAL_INT32(0, state.heading_pid.integral_mv_q16);
    TEST_ASSERT_EQUAL_INT16(0, output.effort.yaw_mv);
    TEST_ASSERT_EQUAL_INT16(0, output.drive.left_q15);
}

static void test_step_takes_the_nominal_battery_until_the_first_reading(void)
{
    state.mixer.battery_mv = 0;
    (void)driven_with(0, 0);
    TEST_ASSERT_EQUAL_UINT16(config.mixer.battery_nominal_mv, state.mixer.battery_mv);
    sensors.have |= SENSOR_BATTERY;
    sensors.battery_mv = 7777;
    (void)driven_with(0, 0);
    sensors.have = SENSOR_GYRO;
    (void)driven_with(0, 0);
    TEST_ASSERT_EQUAL_UINT16(7777, state.mixer.battery_mv);
}

static void test_step_gives_the_monitor_the_voltages_that_made_the_motion(void)
{
    (void)driven_with(100, -50);
    TEST_ASSERT_EQUAL_INT32(100 * BODY_PERIOD_MS, state.monitor.sums.voltage_mv_ms[0]);
    TEST_ASSERT_EQUAL_INT32(-50 * BODY_PERIOD_MS, state.monitor.sums.voltage_mv_ms[1]);
    TEST_ASSERT_EQUAL_INT32(output.estimate.travel_um_q5, state.monitor.sums.travel_um_q5);
    TEST_ASSERT_EQUAL_INT16(output.estimate.speed_mm_s_q4, state.monitor.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT16(output.estimate.yaw_rate_mrad_s, state.monitor.yaw_rate_mrad_s);
    TEST_ASSERT_EQUAL_UINT16(9000, state.monitor.reference_mv);
    TEST_ASSERT_EQUAL(!output.estimate.valid, state.monitor.sums.bad);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_is_driven_where_one_motor_is);
    RUN_TEST(test_step_learns_no_bias_while_one_motor_drives);
    RUN_TEST(test_step_moves_the_model_by_whole_periods);
    RUN_TEST(test_step_adds_friction_to_the_motors_and_takes_it_from_the_model);
    RUN_TEST(test_step_damps_the_controllers_by_what_is_measured);
    RUN_TEST(test_step_holds_the_integral_whose_effort_the_mixer_cuts);
    RUN_TEST(test_step_empties_both_controllers_where_the_robot_may_not_drive);
    RUN_TEST(test_step_takes_the_nominal_battery_until_the_first_reading);
    RUN_TEST(test_step_gives_the_monitor_the_voltages_that_made_the_motion);
    return UNITY_END();
}
