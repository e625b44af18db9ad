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

static const double MOMENT = 0.02;

static void test_a_spin_slows_down_linearly_and_stands(void)
{
    on("yaw_scrub", MOMENT, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(0, sign * 4.0, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, sign * (4 - MOMENT / turn_inertia() * 0.6), state()->yaw_rate);
        coast(0, sign * 4.0, 4 * turn_inertia() / MOMENT + 0.01);
        TEST_ASSERT_TRUE(state()->yaw_rate == 0);
    }
}

static void test_it_holds_up_to_its_moment(void)
{
    const double hold = 0.5 * MOMENT * RADIUS / HALF_TRACK / GAIN;
    on("yaw_scrub", MOMENT, 0, 0);
    start(NULL);
    go(0.999 * hold, -0.999 * hold, 1);
    TEST_ASSERT_TRUE(state()->heading == 0);
    go(3 + 1.01 * hold, 3 - 1.01 * hold, 1);
    TEST_ASSERT_TRUE(state()->yaw_rate > 1e-3);
}

static void test_straight_ahead_nothing_is_lost(void)
{
    on("yaw_scrub", MOMENT, 0, 0);
    coast(0.5, 0, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, state()->surge);
}

static void test_paper_profile_stops_turning(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    on("yaw_scrub", MOMENT, 0, 0);
    coast(0, 4, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 4 - MOMENT / YAW_INERTIA * 0.6, state()->yaw_rate);
    go(NAN, NAN, 1);
    TEST_ASSERT_TRUE(state()->yaw_rate == 0);
}

static void test_a_moment_of_zero_is_off_and_a_motor_does_not_turn(void)
{
    assert_off("yaw_scrub", 0, 0, 0);
    assert_not_of_a_motor("yaw_scrub", MOMENT, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_spin_slows_down_linearly_and_stands);
    RUN_TEST(test_it_holds_up_to_its_moment);
    RUN_TEST(test_straight_ahead_nothing_is_lost);
    RUN_TEST(test_paper_profile_stops_turning);
    RUN_TEST(test_a_moment_of_zero_is_off_and_a_motor_does_not_turn);
    return UNITY_END();
}
