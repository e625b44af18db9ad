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

static void test_the_speed_decays_exponentially_and_the_turn_does_not(void)
{
    on("surge_drag", 0.5, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(sign * 0.5, sign * 2, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, sign * 0.5 * exp(-0.5 * 0.6 / surge_mass()), state()->surge);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, sign * 2, state()->yaw_rate);
    }
}

static void test_the_paper_s_body_feels_it(void)
{
    const bp_state moving = {.surge = 0.5};
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    on("surge_drag", 0.5, 0, 0);
    start(&moving);
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5 * exp(-0.5 * 0.6 / MASS), state()->surge);
}

static void test_it_is_off_at_zero_and_for_a_motor(void)
{
    assert_off("surge_drag", 0, 0, 0);
    assert_not_of_a_motor("surge_drag", 0.5, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_speed_decays_exponentially_and_the_turn_does_not);
    RUN_TEST(test_the_paper_s_body_feels_it);
    RUN_TEST(test_it_is_off_at_zero_and_for_a_motor);
    return UNITY_END();
}
