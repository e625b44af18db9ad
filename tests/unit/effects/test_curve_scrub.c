#include "drive.h"

void setUp(void)
{
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

static const double COEFFICIENT = 0.5;

/* The yaw rate stays constant, so the speed decays exponentially. */
static void test_in_a_curve_the_speed_decays_with_the_yaw_rate(void)
{
    on("curve_scrub", COEFFICIENT, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(0.5, sign * 3.0, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.5 * exp(-COEFFICIENT * MASS * 3 * 0.6 / surge_mass()), state()->surge);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, sign * 3.0, state()->yaw_rate);
        coast(sign * -0.5, 3, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, sign * -0.5 * exp(-COEFFICIENT * MASS * 3 * 0.6 / surge_mass()),
                                  state()->surge);
    }
}

static void test_straight_ahead_nothing_is_lost(void)
{
    on("curve_scrub", COEFFICIENT, 0, 0);
    coast(0.5, 0, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, state()->surge);
}

static void test_a_coefficient_of_zero_is_off_and_a_motor_has_no_curves(void)
{
    assert_off("curve_scrub", 0, 0, 0);
    assert_not_of_a_motor("curve_scrub", COEFFICIENT, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_in_a_curve_the_speed_decays_with_the_yaw_rate);
    RUN_TEST(test_straight_ahead_nothing_is_lost);
    RUN_TEST(test_a_coefficient_of_zero_is_off_and_a_motor_has_no_curves);
    return UNITY_END();
}
