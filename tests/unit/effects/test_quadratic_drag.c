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

static void test_coasting_speed_falls_as_one_over_time(void)
{
    on("quadratic_drag", 2, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(sign * 0.8, 0, 0.9);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, sign * 0.8 / (1 + 2 * 0.8 * 0.9 / surge_mass()), state()->surge);
    }
}

static void test_a_spin_does_not_feel_it(void)
{
    on("quadratic_drag", 2, 0, 0);
    coast(0, 3, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 3, state()->yaw_rate);
}

static void test_paper_profile_feels_it_along_and_across(void)
{
    const bp_state sliding = {.sway = 0.8};
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    on("quadratic_drag", 2, 0, 0);
    coast(0.8, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.8 / (1 + 2 * 0.8 * 0.9 / MASS), state()->surge);
    start(&sliding);
    go(NAN, NAN, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.8 / (1 + 2 * 0.8 * 0.9 / MASS), state()->sway);
}

static void test_a_drag_beyond_the_body_step_only_stops_the_vehicle(void)
{
    for (int profile = BP_COUPLED; profile <= BP_PAPER; profile++) {
        vehicle(BP_DIFF_DRIVE, profile);
        on("quadratic_drag", 1e5, 0, 0);
        coast(1, 0, 0.3);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, state()->surge);
    }
}

static void test_a_linear_axis_reaches_the_root_of_force_over_drag(void)
{
    axis();
    on("quadratic_drag", 300, 0, 0);
    start(NULL);
    go(-2, 0, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -sqrt(100.0 / 300), state()->wheel_speed[0]);
}

static void test_a_drag_of_zero_is_off(void)
{
    assert_off("quadratic_drag", 0, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_coasting_speed_falls_as_one_over_time);
    RUN_TEST(test_a_spin_does_not_feel_it);
    RUN_TEST(test_paper_profile_feels_it_along_and_across);
    RUN_TEST(test_a_drag_beyond_the_body_step_only_stops_the_vehicle);
    RUN_TEST(test_a_linear_axis_reaches_the_root_of_force_over_drag);
    RUN_TEST(test_a_drag_of_zero_is_off);
    return UNITY_END();
}
