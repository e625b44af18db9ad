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

static void test_the_turn_decays_exponentially_and_the_speed_does_not(void)
{
    on("viscous_scrub", 0.005, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(sign * 0.5, sign * 2, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, sign * 2 * exp(-0.005 * 0.6 / turn_inertia()), state()->yaw_rate);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, sign * 0.5, state()->surge);
    }
}

static void test_where_tyres_slip_the_body_feels_it(void)
{
    const bp_state turning = {.yaw_rate = 2};
    set("wheel_inertia", 1e-9);
    on("wheel_slip", 0.01, 100, 0);
    on("viscous_scrub", 0.005, 0, 0);
    start(&turning);
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 2 * exp(-0.005 * 0.6 / YAW_INERTIA), state()->yaw_rate);
}

static void test_it_is_off_at_zero_and_for_a_motor(void)
{
    assert_off("viscous_scrub", 0, 0, 0);
    assert_not_of_a_motor("viscous_scrub", 0.005, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_turn_decays_exponentially_and_the_speed_does_not);
    RUN_TEST(test_where_tyres_slip_the_body_feels_it);
    RUN_TEST(test_it_is_off_at_zero_and_for_a_motor);
    return UNITY_END();
}
