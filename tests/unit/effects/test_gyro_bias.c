#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static const double BIAS = -0.07;

static void test_the_rate_is_off_by_the_bias_and_the_angle_by_its_integral(void)
{
    const bp_state aged = {.age = 50, .heading = 1};
    begin("gyro_bias", &BIAS, &aged);
    TEST_ASSERT_TRUE(seen[OUTPUT_YAW_RATE] == BIAS && seen[OUTPUT_YAW_ANGLE] == 1);
    go(5, -2, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, truth[OUTPUT_YAW_RATE] + BIAS, seen[OUTPUT_YAW_RATE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, truth[OUTPUT_YAW_ANGLE] + BIAS * 0.9, seen[OUTPUT_YAW_ANGLE]);
}

static void test_nothing_else_is_touched(void)
{
    begin("gyro_bias", &BIAS, NULL);
    go(5, -2, 0.3);
    assert_only(OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_rate_is_off_by_the_bias_and_the_angle_by_its_integral);
    RUN_TEST(test_nothing_else_is_touched);
    return UNITY_END();
}
