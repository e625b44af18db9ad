#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static void test_each_accelerometer_has_its_own_bias(void)
{
    const double bias[2] = {0.11, -0.23};
    begin("accel_bias", bias, NULL);
    TEST_ASSERT_TRUE(seen[OUTPUT_ACCEL_SURGE] == 0.11 && seen[OUTPUT_ACCEL_SWAY] == -0.23);
    go(5, -2, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, truth[OUTPUT_ACCEL_SURGE] + 0.11, seen[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, truth[OUTPUT_ACCEL_SWAY] - 0.23, seen[OUTPUT_ACCEL_SWAY]);
    assert_only(OUTPUT_ACCEL_SURGE, OUTPUT_ACCEL_SWAY);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_each_accelerometer_has_its_own_bias);
    return UNITY_END();
}
