#include "affected.h"

static void test_the_run_is_the_nominal_one_that_much_later(void)
{
    const double delay = 0.06;
    use("start_delay", &delay);
    start(plain, NULL);
    go(6, 4, 0.3);
    const bp_state nominal = plant.vehicle.state;
    start(affected, NULL);
    go(6, 4, 0.06);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, plant.vehicle.state.x);
    go(6, 4, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, nominal.x, plant.vehicle.state.x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, nominal.heading, plant.vehicle.state.heading);
}

static void test_a_delay_between_two_steps_lies_between(void)
{
    double x[3];
    for (int i = 0; i < 3; i++) {
        const double delay = 0.06 + 0.0001 * i;
        use("start_delay", &delay);
        start(affected, NULL);
        go(6, 6, 0.3);
        x[i] = plant.vehicle.state.x;
    }
    TEST_ASSERT_TRUE(x[0] > x[1] && x[1] > x[2]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * (x[0] - x[2]), 0.5 * (x[0] + x[2]), x[1]);
}

static void test_later_inputs_are_in_time(void)
{
    const double delay = 0.06;
    use("start_delay", &delay);
    start(affected, NULL);
    go(6, 6, 0.15);
    go(-2, NAN, 0.003);
    TEST_ASSERT_TRUE(plant.vehicle.voltage[0] == -2 && isnan(plant.vehicle.voltage[1]));
}

static void test_a_motor_that_should_float_is_held_until_then(void)
{
    const double delay = 0.06;
    const bp_state moving = {.surge = 0.5};
    use("start_delay", &delay);
    start(affected, &moving);
    go(NAN, NAN, 0.057);
    TEST_ASSERT_TRUE(plant.vehicle.voltage[0] == 0);
    go(NAN, NAN, 0.006);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
}

static void test_no_delay_changes_nothing(void)
{
    const double none = 0;
    use("start_delay", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double delay = 0.1;
    use("start_delay", &delay);
    assert_reversal();
    assert_mirror("start_delay", &delay);
    make_motor("start_delay", &delay);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_run_is_the_nominal_one_that_much_later);
    RUN_TEST(test_a_delay_between_two_steps_lies_between);
    RUN_TEST(test_later_inputs_are_in_time);
    RUN_TEST(test_a_motor_that_should_float_is_held_until_then);
    RUN_TEST(test_no_delay_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
