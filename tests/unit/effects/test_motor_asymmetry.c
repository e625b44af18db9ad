#include "affected.h"

static const double DIFFERENCE = 0.2;

static void test_each_side_gets_its_share_of_the_voltage(void)
{
    use("motor_asymmetry", &DIFFERENCE);
    start(plain, NULL);
    go(6 * 1.1, -4 * 0.9, 0.6);
    const bp_state nominal = plant.vehicle.state;
    start(affected, NULL);
    go(6, -4, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, nominal.x, plant.vehicle.state.x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, nominal.heading, plant.vehicle.state.heading);
}

/* The vehicle turns clockwise, to the weaker side, at the start and later. */
static void test_it_turns_to_the_same_side_at_any_speed(void)
{
    use("motor_asymmetry", &DIFFERENCE);
    start(affected, NULL);
    go(6, 6, 0.03);
    TEST_ASSERT_TRUE(plant.vehicle.state.yaw_rate > 0.01);
    go(6, 6, 10);
    TEST_ASSERT_TRUE(plant.vehicle.state.yaw_rate > 0.1);
}

static void test_no_difference_changes_nothing(void)
{
    const double none = 0;
    use("motor_asymmetry", &none);
    assert_no_effect();
}

static void test_a_lone_motor_has_no_other_side(void)
{
    make_motor("motor_asymmetry", &DIFFERENCE);
    assert_no_effect();
}

static void test_the_sign_turns_over_with_left_and_right(void)
{
    const double mirrored = -DIFFERENCE;
    use("motor_asymmetry", &DIFFERENCE);
    assert_reversal();
    assert_mirror("motor_asymmetry", &mirrored);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_each_side_gets_its_share_of_the_voltage);
    RUN_TEST(test_it_turns_to_the_same_side_at_any_speed);
    RUN_TEST(test_no_difference_changes_nothing);
    RUN_TEST(test_a_lone_motor_has_no_other_side);
    RUN_TEST(test_the_sign_turns_over_with_left_and_right);
    return UNITY_END();
}
