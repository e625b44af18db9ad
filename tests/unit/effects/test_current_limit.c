#include "affected.h"

static const double LIMIT = 2;

static double current_at(double left, double right, double seconds, int side)
{
    go(left, right, seconds);
    return plant.vehicle.state.current[side];
}

static void test_no_more_than_the_limit_flows_at_a_start_and_at_a_reversal(void)
{
    use("current_limit", &LIMIT);
    const double most = LIMIT / affected->parameter[PARAMETER_RESISTANCE];
    start(affected, NULL);
    double largest = 0;
    for (int i = 0; i < 200; i++)
        largest = fmax(largest, fabs(current_at(6, 6, 0.003, 0)));
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * most, most, largest);
    largest = 0;
    for (int i = 0; i < 200; i++)
        largest = fmax(largest, fabs(current_at(-6, 6, 0.003, 0)));
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * most, most, largest);
}

static void test_at_a_steady_speed_nothing_is_missing(void)
{
    use("current_limit", &LIMIT);
    start(plain, NULL);
    go(6, 6, 6);
    const double speed = plant.vehicle.state.wheel_speed[0];
    start(affected, NULL);
    go(6, 6, 6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * speed, speed, plant.vehicle.state.wheel_speed[0]);
}

static void test_floating_stays(void)
{
    use("current_limit", &LIMIT);
    start(affected, NULL);
    go(NAN, 6, 0.3);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
}

static void test_a_limit_out_of_reach_changes_nothing(void)
{
    const double high = 1000;
    use("current_limit", &high);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("current_limit", &LIMIT);
    assert_reversal();
    assert_mirror("current_limit", &LIMIT);
    make_motor("current_limit", &LIMIT);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_no_more_than_the_limit_flows_at_a_start_and_at_a_reversal);
    RUN_TEST(test_at_a_steady_speed_nothing_is_missing);
    RUN_TEST(test_floating_stays);
    RUN_TEST(test_a_limit_out_of_reach_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
