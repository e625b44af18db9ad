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

static void test_it_drives_a_vehicle_that_nothing_else_drives(void)
{
    on("constant_offset", 0.004, 0, 0);
    start(NULL);
    go(0, 0, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -0.004 / EMF_LOSS, state()->wheel_speed[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -0.004 / EMF_LOSS, state()->wheel_speed[1]);
}

static void test_difference_is_of_opposite_sign_at_the_wheels(void)
{
    on("constant_offset", 0.004, 0.001, 0);
    start(NULL);
    go(3, 3, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, (3 * GAIN - 0.005) / EMF_LOSS, state()->wheel_speed[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, (3 * GAIN - 0.003) / EMF_LOSS, state()->wheel_speed[1]);
}

static void test_an_axis_with_friction_and_offset_has_two_speeds(void)
{
    axis();
    set("viscous_friction", 203.5);
    on("coulomb_friction", 20.39, 0, 0);
    on("constant_offset", -3.16, 0.5, 0);
    start(NULL);
    go(2, 0, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, (100 - 20.39 + 3.16) / 203.5, state()->wheel_speed[0]);
    go(-2, 0, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, (-100 + 20.39 + 3.16) / 203.5, state()->wheel_speed[0]);
}

static void test_reversed_it_is_the_other_way_round(void)
{
    on("constant_offset", 0.004, 0.001, 0);
    start(NULL);
    go(5, -2, 1);
    const bp_state forward = *state();
    on("constant_offset", -0.004, -0.001, 0);
    start(NULL);
    go(-5, 2, 1);
    TEST_ASSERT_TRUE(forward.surge == -state()->surge && forward.yaw_rate == -state()->yaw_rate);
}

static void test_an_offset_of_zero_is_off(void)
{
    assert_off("constant_offset", 0, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_it_drives_a_vehicle_that_nothing_else_drives);
    RUN_TEST(test_difference_is_of_opposite_sign_at_the_wheels);
    RUN_TEST(test_an_axis_with_friction_and_offset_has_two_speeds);
    RUN_TEST(test_reversed_it_is_the_other_way_round);
    RUN_TEST(test_an_offset_of_zero_is_off);
    return UNITY_END();
}
