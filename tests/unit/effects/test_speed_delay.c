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

enum { SAMPLES = 200 };

static double past[SAMPLES][OUTPUT_COUNT];

static void drive(int k)
{
    advance(6 * sin(9 * k * STEP), 4 * cos(7 * k * STEP), STEP);
    for (int i = 0; i < OUTPUT_COUNT; i++)
        past[k][i] = truth[i];
}

static int is_speed(int i)
{
    return i == OUTPUT_WHEEL_SPEED_LEFT || i == OUTPUT_WHEEL_SPEED_RIGHT || i == OUTPUT_WHEEL_VELOCITY_LEFT ||
           i == OUTPUT_WHEEL_VELOCITY_RIGHT;
}

static void test_speeds_are_those_of_the_delay_before_and_angles_are_those_of_now(void)
{
    const double delay = 7.25 * STEP;
    begin("speed_delay", &delay, NULL);
    for (int k = 0; k < SAMPLES; k++) {
        drive(k);
        for (int i = 0; k >= 8 && i < OUTPUT_COUNT; i++)
            if (is_speed(i))
                TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.75 * past[k - 7][i] + 0.25 * past[k - 8][i], seen[i]);
            else if (!isnan(truth[i]))
                TEST_ASSERT_TRUE(truth[i] >= seen[i] && truth[i] <= seen[i]);
    }
}

static void test_a_delay_of_zero_changes_nothing(void)
{
    const double none = 0;
    begin("speed_delay", &none, NULL);
    go(7, 3, 0.9);
    assert_only(0, -1);
}

static void test_a_motors_speed_and_velocity_are_late(void)
{
    const double delay = 4 * STEP;
    twin_free();
    twin_new(BP_MOTOR);
    bp_model_set(plain, "wheel_radius", 0.02);
    bp_model_set(changed, "wheel_radius", 0.02);
    begin("speed_delay", &delay, NULL);
    for (int k = 0; k < 100; k++) {
        drive(k);
        if (k >= 4) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, past[k - 4][OUTPUT_SPEED], seen[OUTPUT_SPEED]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, past[k - 4][OUTPUT_VELOCITY], seen[OUTPUT_VELOCITY]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, truth[OUTPUT_ANGLE], seen[OUTPUT_ANGLE]);
        }
    }
    TEST_ASSERT_TRUE(fabs(truth[OUTPUT_SPEED] - seen[OUTPUT_SPEED]) > 1e-3);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_speeds_are_those_of_the_delay_before_and_angles_are_those_of_now);
    RUN_TEST(test_a_delay_of_zero_changes_nothing);
    RUN_TEST(test_a_motors_speed_and_velocity_are_late);
    return UNITY_END();
}
