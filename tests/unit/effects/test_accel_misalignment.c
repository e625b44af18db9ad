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

static const double ANGLE = 0.1;

/* The vehicle speeds up straight ahead. An IMU that is turned clockwise feels that push from its left, as negative
 * sway. */
static void test_a_forward_push_shows_to_the_left_of_an_imu_turned_clockwise(void)
{
    begin("accel_misalignment", &ANGLE, NULL);
    go(6, 6, 0.03);
    TEST_ASSERT_TRUE(truth[OUTPUT_ACCEL_SURGE] > 0.5 && truth[OUTPUT_ACCEL_SWAY] == 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -sin(ANGLE) * truth[OUTPUT_ACCEL_SURGE], seen[OUTPUT_ACCEL_SWAY]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, cos(ANGLE) * truth[OUTPUT_ACCEL_SURGE], seen[OUTPUT_ACCEL_SURGE]);
}

static void test_a_turn_of_the_imu_keeps_the_size_of_the_specific_force(void)
{
    begin("accel_misalignment", &ANGLE, NULL);
    go(6, 3, 0.3);
    TEST_ASSERT_TRUE(fabs(truth[OUTPUT_ACCEL_SWAY]) > 0.1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, hypot(truth[OUTPUT_ACCEL_SURGE], truth[OUTPUT_ACCEL_SWAY]),
                              hypot(seen[OUTPUT_ACCEL_SURGE], seen[OUTPUT_ACCEL_SWAY]));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, atan2(truth[OUTPUT_ACCEL_SWAY], truth[OUTPUT_ACCEL_SURGE]) - ANGLE,
                              atan2(seen[OUTPUT_ACCEL_SWAY], seen[OUTPUT_ACCEL_SURGE]));
    assert_only(OUTPUT_ACCEL_SURGE, OUTPUT_ACCEL_SWAY);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_forward_push_shows_to_the_left_of_an_imu_turned_clockwise);
    RUN_TEST(test_a_turn_of_the_imu_keeps_the_size_of_the_specific_force);
    return UNITY_END();
}
