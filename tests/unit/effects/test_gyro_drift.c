#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static const double RATE = 0.004;

static void test_the_bias_grows_from_power_on_and_the_angle_from_the_start(void)
{
    const bp_state aged = {.age = 50};
    begin("gyro_drift", &RATE, &aged);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, RATE * 50, seen[OUTPUT_YAW_RATE]);
    TEST_ASSERT_TRUE(seen[OUTPUT_YAW_ANGLE] == 0);
    go(5, -2, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, truth[OUTPUT_YAW_RATE] + RATE * 53, seen[OUTPUT_YAW_RATE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, truth[OUTPUT_YAW_ANGLE] + RATE * (53.0 * 53 - 50.0 * 50) / 2,
                              seen[OUTPUT_YAW_ANGLE]);
}

static void test_nothing_else_is_touched(void)
{
    begin("gyro_drift", &RATE, NULL);
    TEST_ASSERT_TRUE(seen[OUTPUT_YAW_RATE] == 0);
    go(5, -2, 0.3);
    assert_only(OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_bias_grows_from_power_on_and_the_angle_from_the_start);
    RUN_TEST(test_nothing_else_is_touched);
    return UNITY_END();
}
