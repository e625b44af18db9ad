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

static const double LAG = 0.05;

/* A very heavy body has a constant yaw acceleration, and the filter's response to a ramp is known in closed form. */
static void test_a_ramp_of_yaw_rate_is_followed_late_by_the_time_constant(void)
{
    bp_model_set(plain, "wheel_inertia", 1e4);
    bp_model_set(changed, "wheel_inertia", 1e4);
    bp_model_set(plain, "inductance", 0);
    bp_model_set(changed, "inductance", 0);
    begin("imu_lag", &LAG, NULL);
    for (int k = 1; k <= 200; k++) {
        advance(1000, -1000, STEP);
        const double t = k * STEP, slope = truth[OUTPUT_YAW_RATE] / t;
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * slope, slope * (t - LAG + LAG * exp(-t / LAG)), seen[OUTPUT_YAW_RATE]);
    }
    TEST_ASSERT_TRUE(truth[OUTPUT_YAW_RATE] > 1e-4);
}

/* The specific force is constant from the first step on, so the reading is the filter's step response, as a mean over
 * each step. */
static void test_a_step_of_acceleration_is_63_percent_there_after_the_time_constant(void)
{
    bp_model_set(plain, "wheel_inertia", 1e4);
    bp_model_set(changed, "wheel_inertia", 1e4);
    bp_model_set(plain, "inductance", 0);
    bp_model_set(changed, "inductance", 0);
    begin("imu_lag", &LAG, NULL);
    for (int k = 1; k <= 100; k++) {
        advance(1000, 1000, STEP);
        const double missing = LAG / STEP * (exp(-(k - 1) * STEP / LAG) - exp(-k * STEP / LAG));
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * truth[OUTPUT_ACCEL_SURGE], truth[OUTPUT_ACCEL_SURGE] * (1 - missing),
                                  seen[OUTPUT_ACCEL_SURGE]);
    }
    TEST_ASSERT_TRUE(truth[OUTPUT_ACCEL_SURGE] > 1e-5);
}

static void test_sway_lags_like_surge_and_the_rest_is_untouched(void)
{
    begin("imu_lag", &LAG, NULL);
    double sway = 0, mean = 0;
    for (int k = 0; k < 100; k++) {
        advance(7, 3, STEP);
        const double passed = (1 - exp(-STEP / LAG)) * (truth[OUTPUT_ACCEL_SWAY] - sway);
        mean = truth[OUTPUT_ACCEL_SWAY] - LAG / STEP * passed; /* y' LAG + y = x, as a mean over the step */
        sway += passed;
    }
    TEST_ASSERT_TRUE(sway > 0.05);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, mean, seen[OUTPUT_ACCEL_SWAY]);
    assert_only(OUTPUT_ACCEL_SURGE, OUTPUT_YAW_ANGLE);
}

static void test_the_angle_is_the_integral_of_the_filtered_rate(void)
{
    const bp_state spinning = {.yaw_rate = 3, .heading = 1};
    begin("imu_lag", &LAG, &spinning);
    double angle = seen[OUTPUT_YAW_ANGLE];
    for (int k = 0; k < 300; k++) {
        const double before = seen[OUTPUT_YAW_RATE];
        advance(2, 7, STEP);
        angle += 0.5 * STEP * (before + seen[OUTPUT_YAW_RATE]);
    }
    TEST_ASSERT_TRUE(fabs(seen[OUTPUT_YAW_ANGLE] - truth[OUTPUT_YAW_ANGLE]) > 0.05);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, angle, seen[OUTPUT_YAW_ANGLE]);
}

static void test_a_run_starts_settled_and_a_time_constant_of_zero_changes_nothing(void)
{
    const bp_state spinning = {.yaw_rate = 3, .surge = 0.2};
    begin("imu_lag", &LAG, &spinning);
    assert_only(0, -1);
    const double none = 0;
    begin("imu_lag", &none, &spinning);
    go(7, 3, 0.3);
    assert_only(0, -1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_ramp_of_yaw_rate_is_followed_late_by_the_time_constant);
    RUN_TEST(test_a_step_of_acceleration_is_63_percent_there_after_the_time_constant);
    RUN_TEST(test_sway_lags_like_surge_and_the_rest_is_untouched);
    RUN_TEST(test_the_angle_is_the_integral_of_the_filtered_rate);
    RUN_TEST(test_a_run_starts_settled_and_a_time_constant_of_zero_changes_nothing);
    return UNITY_END();
}
