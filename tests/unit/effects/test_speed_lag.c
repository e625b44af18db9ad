#include <math.h>

#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static const double LAG = 0.04;

/* Euler's method with a thousandth of the step, on a speed that is linear in the step. */
static double filtered(double behind, double before, double now)
{
    const int parts = 1000;
    for (int j = 0; j < parts; j++)
        behind += STEP / parts / LAG * (before + (now - before) * (j + 0.5) / parts - behind);
    return behind;
}

static void test_speeds_follow_the_truth_with_the_time_constant(void)
{
    begin("speed_lag", &LAG, NULL);
    double behind = seen[OUTPUT_WHEEL_SPEED_LEFT], before = truth[OUTPUT_WHEEL_SPEED_LEFT];
    for (int k = 0; k < 200; k++) {
        advance(6 * sin(9 * k * STEP), 4, STEP);
        behind = filtered(behind, before, truth[OUTPUT_WHEEL_SPEED_LEFT]);
        before = truth[OUTPUT_WHEEL_SPEED_LEFT];
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, behind, seen[OUTPUT_WHEEL_SPEED_LEFT]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, truth[OUTPUT_WHEEL_TRAVEL_LEFT], seen[OUTPUT_WHEEL_TRAVEL_LEFT]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, truth[OUTPUT_YAW_RATE], seen[OUTPUT_YAW_RATE]);
    }
    TEST_ASSERT_TRUE(fabs(truth[OUTPUT_WHEEL_SPEED_LEFT] - seen[OUTPUT_WHEEL_SPEED_LEFT]) > 0.01);
    TEST_ASSERT_TRUE(fabs(truth[OUTPUT_WHEEL_VELOCITY_RIGHT] - seen[OUTPUT_WHEEL_VELOCITY_RIGHT]) > 1e-6);
}

static void test_a_run_starts_settled_and_a_lag_of_zero_changes_nothing(void)
{
    const bp_state moving = {.surge = 0.3, .yaw_rate = 1};
    begin("speed_lag", &LAG, &moving);
    assert_only(0, -1);
    twin_free();
    twin_new(BP_MOTOR);
    const double none = 0;
    begin("speed_lag", &none, NULL);
    go(7, 3, 0.9);
    assert_only(0, -1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_speeds_follow_the_truth_with_the_time_constant);
    RUN_TEST(test_a_run_starts_settled_and_a_lag_of_zero_changes_nothing);
    return UNITY_END();
}
