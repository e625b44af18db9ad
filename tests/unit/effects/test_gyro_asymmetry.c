#include "twin.h"

#include <math.h>

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static const double DIFFERENCE = 0.08;

static void assert_rate(double gain)
{
    TEST_ASSERT_TRUE(fabs(truth[OUTPUT_YAW_RATE]) > 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, gain * truth[OUTPUT_YAW_RATE], seen[OUTPUT_YAW_RATE]);
}

static void test_half_of_it_is_gained_to_the_right_and_lost_to_the_left(void)
{
    begin("gyro_asymmetry", &DIFFERENCE, NULL);
    go(6, -6, 0.6);
    assert_rate(1.04);
    go(-6, 6, 1.2);
    assert_rate(0.96);
    assert_only(OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE);
}

/* Right and back: the error of both ways adds up, from the angle at the start. */
static void test_the_angle_is_the_integral_of_the_rate(void)
{
    const bp_state turned = {.heading = 1.5};
    begin("gyro_asymmetry", &DIFFERENCE, &turned);
    TEST_ASSERT_EQUAL_DOUBLE(1.5, seen[OUTPUT_YAW_ANGLE]);
    double way = 0, last = 1.5;
    for (int i = 0; i < 600; i++) {
        const double left = i < 300 ? 6 : -6;
        advance(left, -left, STEP);
        way += fabs(truth[OUTPUT_YAW_ANGLE] - last);
        last = truth[OUTPUT_YAW_ANGLE];
    }
    TEST_ASSERT_TRUE(way > 4);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, truth[OUTPUT_YAW_ANGLE] + 0.04 * way, seen[OUTPUT_YAW_ANGLE]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_half_of_it_is_gained_to_the_right_and_lost_to_the_left);
    RUN_TEST(test_the_angle_is_the_integral_of_the_rate);
    return UNITY_END();
}
