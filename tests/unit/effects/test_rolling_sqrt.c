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

static const double TORQUE = 0.004;

/* M w' = -torque sqrt(w): the root of the speed falls linearly. */
static void test_coasting_loses_the_root_of_its_speed_linearly(void)
{
    const double inertia = 0.5 * surge_mass() * RADIUS * RADIUS, root = sqrt(0.5 / RADIUS);
    on("rolling_sqrt", TORQUE, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(sign * 0.5, 0, 0.6);
        const double left = root - 0.5 * TORQUE / inertia * 0.6;
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, sign * left * left, state()->wheel_speed[0]);
    }
}

static void test_it_comes_to_rest_for_good(void)
{
    const double inertia = 0.5 * surge_mass() * RADIUS * RADIUS;
    on("rolling_sqrt", TORQUE, 0, 0);
    coast(0.5, 0, 2 * inertia * sqrt(0.5 / RADIUS) / TORQUE + 0.1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0, state()->surge);
}

static void test_steady_speed_balances_motor_and_root(void)
{
    on("rolling_sqrt", TORQUE, 0, 0);
    start(NULL);
    go(6, -6, 10);
    const double w = state()->wheel_speed[0];
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 6 * GAIN, EMF_LOSS * w + TORQUE * sqrt(w));
}

static void test_a_torque_of_zero_is_off(void)
{
    assert_off("rolling_sqrt", 0, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_coasting_loses_the_root_of_its_speed_linearly);
    RUN_TEST(test_it_comes_to_rest_for_good);
    RUN_TEST(test_steady_speed_balances_motor_and_root);
    RUN_TEST(test_a_torque_of_zero_is_off);
    return UNITY_END();
}
