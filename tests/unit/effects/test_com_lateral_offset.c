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

static const double RIGHT = 0.03;

/* m (u' - c r') = X, (J_z + m c^2) r' - m c u' = 0: r' = c X / J_z. */
static void test_a_push_turns_it_about_its_heavy_side(void)
{
    const double push = -2 * -0.004 / RADIUS;
    set("wheel_inertia", 1e-9);
    on("com_lateral_offset", RIGHT, 0, 0);
    on("constant_offset", -0.004, 0, 0);
    coast(0, 0, 0.03);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, RIGHT * push / YAW_INERTIA * 0.03, state()->yaw_rate);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, (push / MASS + RIGHT * RIGHT * push / YAW_INERTIA) * 0.03, state()->surge);
}

static void test_coasting_it_keeps_its_speeds(void)
{
    on("com_lateral_offset", RIGHT, 0, 0);
    coast(0.4, 3, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4, state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, 3, state()->yaw_rate);
}

static void test_forward_and_backward_are_mirror_images(void)
{
    on("com_lateral_offset", RIGHT, 0, 0);
    start(NULL);
    go(5, 4, 0.6);
    const bp_state forward = *state();
    start(NULL);
    go(-5, -4, 0.6);
    TEST_ASSERT_TRUE(forward.surge == -state()->surge && forward.yaw_rate == -state()->yaw_rate);
}

static void test_in_the_paper_profile_thrust_has_its_lever(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    on("com_lateral_offset", RIGHT, 0, 0);
    start(NULL);
    go(6, 6, 0.006);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, state()->surge * MASS * RIGHT / YAW_INERTIA, state()->yaw_rate);
    TEST_ASSERT_TRUE(state()->yaw_rate > 0.01);
}

static void test_an_offset_of_zero_is_off_and_a_motor_has_none(void)
{
    assert_off("com_lateral_offset", 0, 0, 0);
    assert_not_of_a_motor("com_lateral_offset", RIGHT, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_push_turns_it_about_its_heavy_side);
    RUN_TEST(test_coasting_it_keeps_its_speeds);
    RUN_TEST(test_forward_and_backward_are_mirror_images);
    RUN_TEST(test_in_the_paper_profile_thrust_has_its_lever);
    RUN_TEST(test_an_offset_of_zero_is_off_and_a_motor_has_none);
    return UNITY_END();
}
