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

static double slip(void)
{
    return RADIUS * state()->wheel_speed[0] - state()->surge;
}

static void test_steady_slip_follows_the_force_on_the_tyre(void)
{
    const double friction = 0.5, most = friction * 0.5 * MASS * GRAVITY;
    on("wheel_slip", 0.1, friction, 0);
    on("quadratic_drag", 6, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        start(NULL);
        go(sign * 9, sign * 9, 10);
        const double force = 0.5 * 6 * state()->surge * fabs(state()->surge);
        TEST_ASSERT_TRUE(fabs(force) > 0.5);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.1 * force / sqrt(1 - force * force / (most * most)), slip());
    }
}

static void test_no_force_exceeds_friction(void)
{
    on("wheel_slip", 1e-3, 0.1, 0);
    start(NULL);
    go(9, 9, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.1 * GRAVITY * 0.3, state()->surge);
    TEST_ASSERT_TRUE(slip() > 0.1);
    start(NULL);
    go(-9, 9, 0.3);
    const double moment = 0.1 * MASS * GRAVITY * HALF_TRACK;
    TEST_ASSERT_DOUBLE_WITHIN(3e-2, -moment / YAW_INERTIA * 0.3, state()->yaw_rate);
}

/* A tyre that was expected to stick for the whole step would give the vehicle a kick: 7 % of the speed here. */
static void test_firm_tyres_lose_their_hold_within_a_long_step(void)
{
    static const char *const LAW[] = {"wheel_slip", "tyre_grip"};
    for (int i = 0; i < 2; i++) {
        vehicle(BP_DIFF_DRIVE, BP_COUPLED);
        on(LAW[i], 1e-3, 0.1, 0);
        TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, NULL, 0.003, 0.003));
        go(9, 9, 0.3);
        TEST_ASSERT_DOUBLE_WITHIN(0.012 * 0.1 * GRAVITY * 0.3, 0.1 * GRAVITY * 0.3, state()->surge);
    }
}

static void test_firm_tyres_are_the_contact_without_slip(void)
{
    set("drag_area", 0.1);
    on("com_lateral_offset", 0.02, 0, 0);
    on("com_forward_offset", 0.03, 0, 0);
    on("yaw_scrub", 0.01, 0, 0);
    const bp_state rolling = tour();
    on("wheel_slip", 1e-4, 100, 0);
    const bp_state firm = tour();
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, rolling.surge, firm.surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, rolling.yaw_rate, firm.yaw_rate);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, rolling.x, firm.x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, rolling.heading, firm.heading);
}

static void test_wheels_and_body_exchange_momentum_only_with_each_other(void)
{
    const bp_state spinning = {.surge = 0.2, .wheel_speed = {20, 20}};
    on("wheel_slip", 0.05, 0.8, 0);
    start(&spinning);
    const double before = MASS * 0.2 + 2 * WHEEL_INERTIA * 20 / RADIUS;
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, before,
                              MASS * state()->surge + 2 * WHEEL_INERTIA * state()->wheel_speed[0] / RADIUS);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, slip());
}

static void test_dry_friction_of_the_body_still_holds_it(void)
{
    on("wheel_slip", 0.05, 0.8, 0);
    on("yaw_scrub", 0.02, 0, 0);
    start(NULL);
    const double hold = 0.5 * 0.02 * RADIUS / HALF_TRACK / GAIN;
    go(3 + 0.9 * hold, 3 - 0.9 * hold, 1);
    TEST_ASSERT_TRUE(state()->yaw_rate == 0 && state()->surge > 0.1);
}

static void test_paper_profile_and_motor_have_no_tyre(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    assert_off("wheel_slip", 0.1, 0.8, 0);
    assert_not_of_a_motor("wheel_slip", 0.1, 0.8, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_steady_slip_follows_the_force_on_the_tyre);
    RUN_TEST(test_no_force_exceeds_friction);
    RUN_TEST(test_firm_tyres_lose_their_hold_within_a_long_step);
    RUN_TEST(test_firm_tyres_are_the_contact_without_slip);
    RUN_TEST(test_wheels_and_body_exchange_momentum_only_with_each_other);
    RUN_TEST(test_dry_friction_of_the_body_still_holds_it);
    RUN_TEST(test_paper_profile_and_motor_have_no_tyre);
    return UNITY_END();
}
