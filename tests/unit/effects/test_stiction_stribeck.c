#include "drive.h"

void setUp(void)
{
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

static const double COULOMB = 0.004, BREAKAWAY = 0.003, STRIBECK = 5;

static void test_a_wheel_at_rest_holds_up_to_breakaway(void)
{
    const double hold = (COULOMB + BREAKAWAY) / GAIN;
    on("stiction_stribeck", COULOMB, BREAKAWAY, STRIBECK);
    start(NULL);
    go(0.999 * hold, -0.999 * hold, 2);
    TEST_ASSERT_TRUE(state()->wheel_angle[0] == 0 && state()->heading == 0);
    go(1.1 * hold, -1.1 * hold, 1);
    TEST_ASSERT_TRUE(state()->yaw_rate > 0.1);
}

static void test_at_the_stribeck_speed_a_part_1_over_e_of_breakaway_is_left(void)
{
    const double torque = COULOMB + BREAKAWAY * exp(-1) + EMF_LOSS * STRIBECK;
    const bp_state moving = {.wheel_speed = {STRIBECK + 1, STRIBECK + 1}};
    on("stiction_stribeck", COULOMB, BREAKAWAY, STRIBECK);
    start(&moving);
    go(torque / GAIN, torque / GAIN, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, STRIBECK, state()->wheel_speed[0]);
}

static void test_a_fast_wheel_feels_coulomb_friction_alone(void)
{
    on("stiction_stribeck", COULOMB, BREAKAWAY, 1);
    start(NULL);
    go(-9, -9, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -(9 * GAIN - COULOMB) / EMF_LOSS, state()->wheel_speed[0]);
}

static void test_a_linear_axis_has_it_in_newton(void)
{
    axis();
    set("viscous_friction", 100);
    on("stiction_stribeck", 20, 10, 0.01);
    start(NULL);
    go(29.9 / 50, 0, 1);
    TEST_ASSERT_TRUE(state()->wheel_speed[0] == 0);
    go(30.5 / 50, 0, 20);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, (30.5 - 20) / 100, state()->wheel_speed[0]);
}

static void test_without_friction_it_is_off(void)
{
    assert_off("stiction_stribeck", 0, 0, 1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_wheel_at_rest_holds_up_to_breakaway);
    RUN_TEST(test_at_the_stribeck_speed_a_part_1_over_e_of_breakaway_is_left);
    RUN_TEST(test_a_fast_wheel_feels_coulomb_friction_alone);
    RUN_TEST(test_a_linear_axis_has_it_in_newton);
    RUN_TEST(test_without_friction_it_is_off);
    return UNITY_END();
}
