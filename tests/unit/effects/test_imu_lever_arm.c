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

static const double ARM[2] = {0.05, -0.03};

/* In a spin on the spot the centre of mass feels nothing, so the reading is that of the lever arm alone. */
static void test_a_spin_shows_the_centripetal_and_the_tangential_part(void)
{
    begin("imu_lever_arm", ARM, NULL);
    go(6, -6, 0.06);
    const double before = truth[OUTPUT_YAW_RATE];
    advance(6, -6, STEP);
    const double rate = 0.5 * (before + truth[OUTPUT_YAW_RATE]), growth = (truth[OUTPUT_YAW_RATE] - before) / STEP;
    TEST_ASSERT_TRUE(growth > 1 && rate > 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -rate * rate * ARM[0] - growth * ARM[1], seen[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -rate * rate * ARM[1] + growth * ARM[0], seen[OUTPUT_ACCEL_SWAY]);
    assert_only(OUTPUT_ACCEL_SURGE, OUTPUT_ACCEL_SWAY);
}

static void test_the_first_sample_has_the_centripetal_part_alone(void)
{
    const bp_state spinning = {.yaw_rate = 4};
    begin("imu_lever_arm", ARM, &spinning);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -16 * ARM[0], seen[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -16 * ARM[1], seen[OUTPUT_ACCEL_SWAY]);
}

/* The arm's velocity relative to the centre of mass, in the earth's frame, is the integral of what the arm adds. */
static void test_what_the_arm_adds_is_the_second_derivative_of_its_path(void)
{
    double east = 0, north = 0;
    begin("imu_lever_arm", ARM, NULL);
    for (int i = 0; i < 200; i++) {
        const double before = truth[OUTPUT_YAW_ANGLE];
        advance(6, -3, STEP);
        const double middle = 0.5 * (before + truth[OUTPUT_YAW_ANGLE]);
        const double surge = seen[OUTPUT_ACCEL_SURGE] - truth[OUTPUT_ACCEL_SURGE];
        const double sway = seen[OUTPUT_ACCEL_SWAY] - truth[OUTPUT_ACCEL_SWAY];
        north += STEP * (surge * cos(middle) - sway * sin(middle));
        east += STEP * (surge * sin(middle) + sway * cos(middle));
    }
    const double heading = truth[OUTPUT_YAW_ANGLE], rate = truth[OUTPUT_YAW_RATE];
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, rate * (-ARM[0] * sin(heading) - ARM[1] * cos(heading)), north);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, rate * (ARM[0] * cos(heading) - ARM[1] * sin(heading)), east);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_spin_shows_the_centripetal_and_the_tangential_part);
    RUN_TEST(test_the_first_sample_has_the_centripetal_part_alone);
    RUN_TEST(test_what_the_arm_adds_is_the_second_derivative_of_its_path);
    return UNITY_END();
}
