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

static const double MISMATCH = 0.06;

static void test_equal_wheel_speeds_turn_it(void)
{
    const bp_state rolling = {.wheel_speed = {10, 10}};
    on("wheel_radius_mismatch", MISMATCH, 0, 0);
    start(&rolling);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 10 * RADIUS, state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 10 * RADIUS * MISMATCH / (2 * HALF_TRACK), state()->yaw_rate);
    const bp_state straight = {.surge = 0.4};
    start(&straight);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4 / (RADIUS * 1.03), state()->wheel_speed[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, state()->yaw_rate);
}

static void test_work_of_the_wheels_is_the_energy_of_the_body(void)
{
    on("wheel_radius_mismatch", MISMATCH, 0, 0);
    on("constant_offset", -0.01, 0.002, 0);
    coast(0, 0, 0.6);
    const double *w = state()->wheel_speed;
    const double energy = 0.5 * MASS * state()->surge * state()->surge +
                          0.5 * YAW_INERTIA * state()->yaw_rate * state()->yaw_rate +
                          0.5 * WHEEL_INERTIA * (w[0] * w[0] + w[1] * w[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.008 * state()->wheel_angle[0] + 0.012 * state()->wheel_angle[1], energy);
}

static void test_dry_yaw_friction_holds_the_body_not_the_difference_of_wheel_speeds(void)
{
    on("wheel_radius_mismatch", MISMATCH, 0, 0);
    on("yaw_scrub", 1, 0, 0);
    start(NULL);
    go(6, 6, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, state()->yaw_rate);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.03 * state()->wheel_speed[0], 0.97 * state()->wheel_speed[1]);
}

static void test_odometry_still_uses_the_nominal_radius(void)
{
    const bp_state rolling = {.wheel_speed = {10, 10}};
    on("wheel_radius_mismatch", MISMATCH, 0, 0);
    start(&rolling);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 10 * RADIUS, out[OUTPUT_WHEEL_VELOCITY_LEFT]);
}

static void test_in_the_paper_profile_a_smaller_wheel_pushes_more(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    on("wheel_radius_mismatch", MISMATCH, 0, 0);
    start(NULL);
    go(6, 6, 0.03);
    TEST_ASSERT_TRUE(state()->yaw_rate < -1e-3);
}

static void test_equal_wheels_are_off_and_a_motor_has_one(void)
{
    set("drag_area", 0.1);
    assert_off("wheel_radius_mismatch", 0, 0, 0);
    assert_not_of_a_motor("wheel_radius_mismatch", MISMATCH, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_equal_wheel_speeds_turn_it);
    RUN_TEST(test_work_of_the_wheels_is_the_energy_of_the_body);
    RUN_TEST(test_dry_yaw_friction_holds_the_body_not_the_difference_of_wheel_speeds);
    RUN_TEST(test_odometry_still_uses_the_nominal_radius);
    RUN_TEST(test_in_the_paper_profile_a_smaller_wheel_pushes_more);
    RUN_TEST(test_equal_wheels_are_off_and_a_motor_has_one);
    return UNITY_END();
}
