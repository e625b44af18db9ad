#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static const double ERROR = 0.08;

static void test_rate_and_angle_turned_are_too_large_by_the_error(void)
{
    const bp_state turned = {.heading = 2};
    begin("gyro_scale", &ERROR, &turned);
    TEST_ASSERT_TRUE(seen[OUTPUT_YAW_RATE] == 0 && seen[OUTPUT_YAW_ANGLE] == 2);
    go(5, -2, 0.9);
    TEST_ASSERT_TRUE(truth[OUTPUT_YAW_RATE] > 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.08 * truth[OUTPUT_YAW_RATE], seen[OUTPUT_YAW_RATE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2 + 1.08 * (truth[OUTPUT_YAW_ANGLE] - 2), seen[OUTPUT_YAW_ANGLE]);
    assert_only(OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE);
}

/* The bias follows the scale in the chain, whichever of the two was switched on first. */
static void test_a_bias_is_not_scaled(void)
{
    const double bias = 0.5;
    bp_model_add_effect(changed, "gyro_bias", &bias);
    begin("gyro_scale", &ERROR, NULL);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.5, seen[OUTPUT_YAW_RATE]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_rate_and_angle_turned_are_too_large_by_the_error);
    RUN_TEST(test_a_bias_is_not_scaled);
    return UNITY_END();
}
