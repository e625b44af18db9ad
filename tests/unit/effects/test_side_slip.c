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

static void test_sway_decays_with_mass_times_creep(void)
{
    const bp_state sliding = {.sway = 0.1};
    on("side_slip", 0.3, 100, 0);
    start(&sliding);
    go(NAN, NAN, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.1 * exp(-0.3 / (MASS * 0.3)), state()->sway);
}

static void test_no_side_force_exceeds_friction(void)
{
    const bp_state sliding = {.sway = -1};
    on("side_slip", 1e-4, 0.2, 0);
    start(&sliding);
    go(NAN, NAN, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, -1 + 0.2 * GRAVITY * 0.3, state()->sway);
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, state()->sway);
}

static void test_a_curve_slides_outward_and_costs_speed(void)
{
    on("side_slip", 0.2, 100, 0);
    on("quadratic_drag", 1, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        start(NULL);
        go(6 + sign, 6 - sign, 10);
        const double u = state()->surge, v = state()->sway, r = state()->yaw_rate;
        TEST_ASSERT_TRUE(sign * r > 1);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3 * fabs(v), -MASS * u * r / (1 / 0.2 + fabs(v)), v);
        const double torque = 2 * 0.195 * 0.5 * (state()->current[0] + state()->current[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, u * fabs(u) - MASS * v * r, torque / RADIUS);
    }
}

/* Kinetic energy is kept where nothing is lost: no grip, no friction. */
static void test_on_ice_the_centre_of_mass_goes_straight(void)
{
    const bp_state moving = {.surge = 0.4, .yaw_rate = 2};
    set("wheel_inertia", 1e-9);
    on("side_slip", 100, 1e-3, 0);
    on("wheel_slip", 100, 1e-3, 0);
    on("com_forward_offset", 0.05, 0, 0);
    set("gravity", 0);
    start(&moving);
    go(NAN, NAN, 1.5);
    const double heading = state()->heading;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 3, heading);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.05 + 0.4 * 1.5, state()->x + 0.05 * cos(heading));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.05 * 2 * 1.5, state()->y + 0.05 * sin(heading));
}

static void test_firm_tyres_are_the_contact_without_slip(void)
{
    on("com_forward_offset", 0.03, 0, 0);
    const bp_state rolling = tour();
    on("side_slip", 1e-4, 100, 0);
    const bp_state firm = tour();
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, rolling.surge, firm.surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, rolling.yaw_rate, firm.yaw_rate);
}

static void test_paper_profile_and_motor_have_no_tyre(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    assert_off("side_slip", 0.1, 0.8, 0);
    assert_not_of_a_motor("side_slip", 0.1, 0.8, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sway_decays_with_mass_times_creep);
    RUN_TEST(test_no_side_force_exceeds_friction);
    RUN_TEST(test_a_curve_slides_outward_and_costs_speed);
    RUN_TEST(test_on_ice_the_centre_of_mass_goes_straight);
    RUN_TEST(test_firm_tyres_are_the_contact_without_slip);
    RUN_TEST(test_paper_profile_and_motor_have_no_tyre);
    return UNITY_END();
}
