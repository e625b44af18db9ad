#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static const double LIMIT = 2;

static void test_the_rate_stays_at_the_end_of_the_range_in_both_directions(void)
{
    begin("gyro_saturation", &LIMIT, NULL);
    go(9, -9, 0.9);
    TEST_ASSERT_TRUE(truth[OUTPUT_YAW_RATE] > 2.5 && seen[OUTPUT_YAW_RATE] == LIMIT);
    go(-9, 9, 1.8);
    TEST_ASSERT_TRUE(truth[OUTPUT_YAW_RATE] < -2.5 && seen[OUTPUT_YAW_RATE] == -LIMIT);
    assert_only(OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE);
}

static void test_within_the_range_nothing_is_touched(void)
{
    begin("gyro_saturation", &LIMIT, NULL);
    go(0.6, -0.6, 0.9);
    TEST_ASSERT_TRUE(truth[OUTPUT_YAW_RATE] > 0.5 && truth[OUTPUT_YAW_RATE] < LIMIT);
    assert_only(0, -1);
}

/* Nothing brakes the spin: the vehicle turns on at 5 rad/s, of which the gyro counts 2. */
static void test_the_angle_is_the_integral_of_the_clipped_rate(void)
{
    const bp_state spinning = {.yaw_rate = -5};
    bp_model_set(plain, "wheel_inertia", 1e4);
    bp_model_set(changed, "wheel_inertia", 1e4);
    begin("gyro_saturation", &LIMIT, &spinning);
    go(0, 0, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, -5 * 0.6, truth[OUTPUT_YAW_ANGLE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, -2 * 0.6, seen[OUTPUT_YAW_ANGLE]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_rate_stays_at_the_end_of_the_range_in_both_directions);
    RUN_TEST(test_within_the_range_nothing_is_touched);
    RUN_TEST(test_the_angle_is_the_integral_of_the_clipped_rate);
    return UNITY_END();
}
