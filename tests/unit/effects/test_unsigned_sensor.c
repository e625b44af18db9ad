#include "twin.h"

#include <math.h>

static const double WHOLE = 1, HALF = 0.5;

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static void test_speeds_lose_their_sign(void)
{
    begin("unsigned_sensor", &WHOLE, NULL);
    go(6, -3, 0.9);
    for (int k = 0; k < 2; k++) {
        TEST_ASSERT_EQUAL_DOUBLE(fabs(truth[OUTPUT_WHEEL_SPEED_LEFT + k]), seen[OUTPUT_WHEEL_SPEED_LEFT + k]);
        TEST_ASSERT_EQUAL_DOUBLE(fabs(truth[OUTPUT_WHEEL_VELOCITY_LEFT + k]), seen[OUTPUT_WHEEL_VELOCITY_LEFT + k]);
    }
    TEST_ASSERT_TRUE(truth[OUTPUT_WHEEL_SPEED_RIGHT] < -1);
    assert_only(OUTPUT_WHEEL_SPEED_LEFT, OUTPUT_WHEEL_VELOCITY_RIGHT);
}

/* There and back: what was turned backward counts forward, from the angle at the start. */
static void test_an_angle_counts_both_ways_from_where_it_began(void)
{
    const bp_state rolled = {.wheel_angle = {3, -4}};
    begin("unsigned_sensor", &WHOLE, &rolled);
    TEST_ASSERT_EQUAL_DOUBLE(-4, seen[OUTPUT_WHEEL_ANGLE_RIGHT]);
    go(6, 6, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, truth[OUTPUT_WHEEL_ANGLE_LEFT], seen[OUTPUT_WHEEL_ANGLE_LEFT]);
    double farthest = truth[OUTPUT_WHEEL_ANGLE_LEFT];
    for (int i = 0; i < 300; i++) {
        advance(-6, -6, STEP);
        farthest = fmax(farthest, truth[OUTPUT_WHEEL_ANGLE_LEFT]);
    }
    const double back = farthest - truth[OUTPUT_WHEEL_ANGLE_LEFT];
    TEST_ASSERT_TRUE(back > 2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, farthest + back, seen[OUTPUT_WHEEL_ANGLE_LEFT]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0408 * (farthest - 3 + back), seen[OUTPUT_WHEEL_TRAVEL_LEFT] - 0.0408 * 3);
}

static void test_half_of_it_leaves_nothing_of_a_turn_backward(void)
{
    begin("unsigned_sensor", &HALF, NULL);
    go(-6, 6, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, seen[OUTPUT_WHEEL_SPEED_LEFT]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, seen[OUTPUT_WHEEL_ANGLE_LEFT]);
    TEST_ASSERT_EQUAL_DOUBLE(truth[OUTPUT_WHEEL_SPEED_RIGHT], seen[OUTPUT_WHEEL_SPEED_RIGHT]);
}

static void test_a_motor_loses_the_sign_of_its_four_readings(void)
{
    twin_free();
    twin_new(BP_MOTOR);
    bp_model_set(plain, "wheel_radius", 0.02);
    bp_model_set(changed, "wheel_radius", 0.02);
    begin("unsigned_sensor", &WHOLE, NULL);
    go(-6, 0, 0.9);
    for (int i = OUTPUT_SPEED; i <= OUTPUT_VELOCITY; i++) {
        TEST_ASSERT_TRUE(truth[i] < -0.01);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, -truth[i], seen[i]);
    }
    assert_only(OUTPUT_SPEED, OUTPUT_VELOCITY);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_speeds_lose_their_sign);
    RUN_TEST(test_an_angle_counts_both_ways_from_where_it_began);
    RUN_TEST(test_half_of_it_leaves_nothing_of_a_turn_backward);
    RUN_TEST(test_a_motor_loses_the_sign_of_its_four_readings);
    return UNITY_END();
}
