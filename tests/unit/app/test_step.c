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

static void test_step_takes_the_nominal_battery_until_the_first_reading(void)
{
    state.mixer.battery_mv = 0;
    (void)driven_with(0, 0);
    TEST_ASSERT_EQUAL_UINT16(config.battery_nominal_mv, state.mixer.battery_mv);
    sensors.have |= SENSOR_BATTERY;
    sensors.battery_mv = 7777;
    (void)driven_with(0, 0);
    sensors.have = SENSOR_GYRO;
    (void)driven_with(0, 0);
    TEST_ASSERT_EQUAL_UINT16(7777, state.mixer.battery_mv);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_is_driven_where_one_motor_is);
    RUN_TEST(test_step_learns_no_bias_while_one_motor_drives);
    RUN_TEST(test_step_takes_the_nominal_battery_until_the_first_reading);
    return UNITY_END();
}
