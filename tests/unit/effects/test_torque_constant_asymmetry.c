#include "affected.h"

static const double DIFFERENCE = 0.2;

/* In the paper profile the wheels turn independently. Each turns like a wheel of a robot whose motors all have its
 * constants. */
static void test_each_motor_has_its_own_flux(void)
{
    make(BP_DIFF_DRIVE, BP_PAPER);
    use("torque_constant_asymmetry", &DIFFERENCE);
    const bp_state both = tour(affected, 6, 3.3);
    for (int k = 0; k < 2; k++) {
        const double flux = k == 0 ? 1.1 : 0.9;
        bp_model_set(plain, "torque_constant", 0.195 * flux);
        bp_model_set(plain, "emf_constant", 0.245 * flux);
        const bp_state one = tour(plain, 6, 3.3);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, one.wheel_speed[k], both.wheel_speed[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, one.wheel_angle[k], both.wheel_angle[k]);
    }
}

/* The stronger side starts first and then runs slower, which no gain of the voltage does. */
static void test_it_turns_to_one_side_at_the_start_and_to_the_other_at_speed(void)
{
    use("torque_constant_asymmetry", &DIFFERENCE);
    start(affected, NULL);
    go(6, 6, 0.03);
    TEST_ASSERT_TRUE(plant.vehicle.state.yaw_rate > 0.01);
    go(6, 6, 10);
    TEST_ASSERT_TRUE(plant.vehicle.state.yaw_rate < -0.1);
}

static void test_no_difference_changes_nothing(void)
{
    const double none = 0;
    use("torque_constant_asymmetry", &none);
    assert_no_effect();
}

static void test_a_lone_motor_has_no_other_side(void)
{
    make_motor("torque_constant_asymmetry", &DIFFERENCE);
    assert_no_effect();
}

static void test_the_sign_turns_over_with_left_and_right(void)
{
    const double mirrored = -DIFFERENCE;
    use("torque_constant_asymmetry", &DIFFERENCE);
    assert_reversal();
    assert_mirror("torque_constant_asymmetry", &mirrored);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_each_motor_has_its_own_flux);
    RUN_TEST(test_it_turns_to_one_side_at_the_start_and_to_the_other_at_speed);
    RUN_TEST(test_no_difference_changes_nothing);
    RUN_TEST(test_a_lone_motor_has_no_other_side);
    RUN_TEST(test_the_sign_turns_over_with_left_and_right);
    return UNITY_END();
}
