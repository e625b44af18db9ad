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

static const double FORWARD = 0.04;

/* Without losses and wheels' inertia it is the Chaplygin sleigh: u = U tanh(U a m t / I + atanh(u_0 / U)), I = J_z +
 * m a^2, m U^2 = m u_0^2 + I r_0^2: it ends ahead of its centre of mass' way, all energy in the surge. */
static void test_coasting_it_is_the_chaplygin_sleigh(void)
{
    const double inertia = YAW_INERTIA + MASS * FORWARD * FORWARD;
    set("wheel_inertia", 1e-9);
    for (int sign = -1; sign <= 1; sign += 2) {
        const double top = sqrt(0.3 * 0.3 + inertia * 9 / MASS);
        on("com_forward_offset", sign * FORWARD, 0, 0);
        coast(0.3, 3, 0.3);
        const double end = top * tanh(sign * top * FORWARD * MASS * 0.3 / inertia + atanh(0.3 / top));
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, end, state()->surge);
        coast(0.3, 3, 6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, sign * top, state()->surge);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, state()->yaw_rate);
    }
}

static void test_straight_ahead_nothing_changes(void)
{
    start(NULL);
    go(6, 6, 0.6);
    const bp_state plain = *state();
    on("com_forward_offset", FORWARD, 0, 0);
    start(NULL);
    go(6, 6, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, plain.surge, state()->surge);
    TEST_ASSERT_TRUE(state()->yaw_rate == 0);
}

static void test_in_the_paper_profile_side_forces_turn_it(void)
{
    const bp_state sliding = {.sway = 0.5};
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    on("quadratic_drag", 2, 0, 0);
    on("com_forward_offset", FORWARD, 0, 0);
    start(&sliding);
    go(NAN, NAN, BODY_STEP);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 2 * 0.25 * FORWARD / YAW_INERTIA * BODY_STEP, state()->yaw_rate);
}

static void test_an_offset_of_zero_is_off_and_a_motor_has_none(void)
{
    assert_off("com_forward_offset", 0, 0, 0);
    assert_not_of_a_motor("com_forward_offset", FORWARD, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_coasting_it_is_the_chaplygin_sleigh);
    RUN_TEST(test_straight_ahead_nothing_changes);
    RUN_TEST(test_in_the_paper_profile_side_forces_turn_it);
    RUN_TEST(test_an_offset_of_zero_is_off_and_a_motor_has_none);
    return UNITY_END();
}
