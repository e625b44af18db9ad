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

static void test_the_gyro_is_late_and_nothing_else_is(void)
{
    const double delay = 5.5 * STEP;
    begin("gyro_delay", &delay, NULL);
    for (int k = 0; k < SAMPLES; k++) {
        advance(6 * sin(9 * k * STEP), 4 * cos(7 * k * STEP), STEP);
        for (int i = 0; i < OUTPUT_COUNT; i++)
            past[k][i] = truth[i];
        for (int i = OUTPUT_YAW_RATE; k >= 6 && i <= OUTPUT_YAW_ANGLE; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, (past[k - 5][i] + past[k - 6][i]) / 2, seen[i]);
    }
    TEST_ASSERT_TRUE(fabs(truth[OUTPUT_YAW_ANGLE] - seen[OUTPUT_YAW_ANGLE]) > 1e-3);
    assert_only(OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE);
}

static void test_a_delay_of_zero_changes_nothing(void)
{
    const double none = 0;
    begin("gyro_delay", &none, NULL);
    go(7, 3, 0.9);
    assert_only(0, -1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_gyro_is_late_and_nothing_else_is);
    RUN_TEST(test_a_delay_of_zero_changes_nothing);
    return UNITY_END();
}
