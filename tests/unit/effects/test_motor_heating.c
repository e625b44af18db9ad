#include "affected.h"

static const double COPPER = 0.00393;
static const double VALUES[] = {300, 20};

static void stall(void)
{
    use("motor_heating", VALUES);
    set("wheel_inertia", 1e4);
}

/* T = thermal_resistance V^2 / (R (1 + COPPER T)). */
static double stalled_heat(double voltage)
{
    const double most = VALUES[0] * voltage * voltage / 22;
    return (-1 + sqrt(1 + 4 * COPPER * most)) / (2 * COPPER);
}

static void test_a_stalled_motor_warms_to_where_it_gives_off_what_it_takes(void)
{
    stall();
    start(affected, NULL);
    go(6, -3, 300);
    const bp_state *state = &plant.vehicle.state;
    TEST_ASSERT_DOUBLE_WITHIN(0.05, stalled_heat(6), state->heat[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, stalled_heat(3), state->heat[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 6 / (22 * (1 + COPPER * stalled_heat(6))), state->current[0]);
}

static void test_it_warms_at_first_by_its_power(void)
{
    stall();
    start(affected, NULL);
    go(6, 6, 0.15);
    const double expected = VALUES[0] * 36 / 22 * (0.15 / VALUES[1]);
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * expected, expected, plant.vehicle.state.heat[0]);
}

static void test_without_current_it_cools_with_the_time_constant(void)
{
    use("motor_heating", VALUES);
    const bp_state warm = {.heat = {50, 20}};
    start(affected, &warm);
    go(NAN, NAN, 10);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 50 * exp(-10 / VALUES[1]), plant.vehicle.state.heat[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 20 * exp(-10 / VALUES[1]), plant.vehicle.state.heat[1]);
}

static void test_a_rest_before_the_run_cools_the_same(void)
{
    use("motor_heating", VALUES);
    const bp_state warm = {.heat = {50, 20}, .rest = 10};
    start(affected, &warm);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 50 * exp(-10 / VALUES[1]), plant.vehicle.state.heat[0]);
    TEST_ASSERT_TRUE(plant.vehicle.state.rest == 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 22 * (1 + COPPER * 50 * exp(-10 / VALUES[1])), plant.vehicle.motor[0].resistance);
}

static void test_two_runs_heat_as_one(void)
{
    stall();
    start(affected, NULL);
    go(6, 6, 3);
    const bp_state half = plant.vehicle.state;
    go(6, 6, 3);
    const bp_state whole = plant.vehicle.state;
    start(affected, &half);
    go(6, 6, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, whole.heat[0], plant.vehicle.state.heat[0]);
}

static void test_no_thermal_resistance_changes_nothing(void)
{
    const double none[] = {0, 20};
    use("motor_heating", none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double hot[] = {10000, 1};
    use("motor_heating", hot);
    assert_reversal();
    assert_mirror("motor_heating", hot);
    make_motor("motor_heating", hot);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_stalled_motor_warms_to_where_it_gives_off_what_it_takes);
    RUN_TEST(test_it_warms_at_first_by_its_power);
    RUN_TEST(test_without_current_it_cools_with_the_time_constant);
    RUN_TEST(test_a_rest_before_the_run_cools_the_same);
    RUN_TEST(test_two_runs_heat_as_one);
    RUN_TEST(test_no_thermal_resistance_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
