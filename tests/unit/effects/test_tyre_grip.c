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

static void test_straight_on_it_is_the_law_of_one_tyre(void)
{
    const double friction = 0.5, most = friction * 0.5 * MASS * GRAVITY;
    on("tyre_grip", 0.1, friction, 0);
    on("quadratic_drag", 6, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        start(NULL);
        go(sign * 9, sign * 9, 10);
        const double force = 0.5 * 6 * state()->surge * fabs(state()->surge);
        TEST_ASSERT_TRUE(fabs(force) > 0.5);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.1 * force / sqrt(1 - force * force / (most * most)), slip());
    }
}

/* Both tyres hold, each with 1 / creep. */
static void test_sway_decays_with_half_the_creep_of_a_tyre(void)
{
    const bp_state sliding = {.sway = -0.1};
    on("tyre_grip", 0.6, 100, 0);
    start(&sliding);
    go(NAN, NAN, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, -0.1 * exp(-0.3 * 2 / (MASS * 0.6)), state()->sway);
}

/* Wheels too heavy to change their speed slip by 1 m/s in the direction `angle`. Returns what the floor gives the body,
 * over its mass: mean of a body step. */
static void accelerations(double angle, double creep, double friction, double *ahead, double *aside)
{
    const double wheel = cos(angle) / RADIUS;
    const bp_state sliding = {.sway = -sin(angle), .wheel_speed = {wheel, wheel}, .surge = 1e-12};
    set("wheel_inertia", 1e4);
    on("tyre_grip", creep, friction, 0);
    start(&sliding);
    go(NAN, NAN, BODY_STEP);
    *ahead = state()->surge / BODY_STEP;
    *aside = (state()->sway + sin(angle)) / BODY_STEP;
}

/* |a| = 2 / m times s / sqrt(creep^2 + (s / (friction m g / 2))^2), against the slip, whatever its direction. */
static void test_the_force_is_a_circle(void)
{
    static const double CREEP[] = {1e-3, 1, 10}, FRICTION = 0.4;
    const double most = FRICTION * 0.5 * MASS * GRAVITY;
    for (int i = 0; i < 3; i++)
        for (double angle = -3; angle <= 3; angle += 0.75) {
            double ahead, aside;
            accelerations(angle, CREEP[i], FRICTION, &ahead, &aside);
            const double size = 2 / MASS / sqrt(CREEP[i] * CREEP[i] + 1 / (most * most));
            TEST_ASSERT_DOUBLE_WITHIN(0.015 * size, size * cos(angle), ahead);
            TEST_ASSERT_DOUBLE_WITHIN(0.015 * size, size * sin(angle), aside);
        }
}

static void test_a_wheel_that_spins_holds_less_sideways(void)
{
    double ahead, little, aside;
    accelerations(0.1, 1e-3, 0.4, &ahead, &little);
    accelerations(1.5, 1e-3, 0.4, &ahead, &aside);
    TEST_ASSERT_TRUE(little < 0.15 * aside);
}

static void test_wheels_and_body_exchange_momentum_only_with_each_other(void)
{
    const bp_state spinning = {.surge = 0.2, .wheel_speed = {20, 20}};
    on("tyre_grip", 0.05, 0.8, 0);
    start(&spinning);
    const double before = MASS * 0.2 + 2 * WHEEL_INERTIA * 20 / RADIUS;
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, before,
                              MASS * state()->surge + 2 * WHEEL_INERTIA * state()->wheel_speed[0] / RADIUS);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, slip());
}

static void test_firm_tyres_are_the_contact_without_slip(void)
{
    on("com_lateral_offset", 0.02, 0, 0);
    on("com_forward_offset", 0.03, 0, 0);
    const bp_state rolling = tour();
    on("tyre_grip", 1e-4, 100, 0);
    const bp_state firm = tour();
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, rolling.surge, firm.surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, rolling.yaw_rate, firm.yaw_rate);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, rolling.x, firm.x);
}

static void test_it_replaces_the_other_laws_of_a_tyre(void)
{
    on("tyre_grip", 0.1, 0.5, 0);
    const bp_state alone = tour();
    on("wheel_slip", 0.3, 0.2, 0);
    on("side_slip", 0.3, 0.2, 0);
    const bp_state beside = tour();
    TEST_ASSERT_EQUAL_MEMORY(&alone, &beside, sizeof alone);
}

static void test_paper_profile_and_motor_have_no_tyre(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    assert_off("tyre_grip", 0.1, 0.8, 0);
    assert_not_of_a_motor("tyre_grip", 0.1, 0.8, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_straight_on_it_is_the_law_of_one_tyre);
    RUN_TEST(test_sway_decays_with_half_the_creep_of_a_tyre);
    RUN_TEST(test_the_force_is_a_circle);
    RUN_TEST(test_a_wheel_that_spins_holds_less_sideways);
    RUN_TEST(test_wheels_and_body_exchange_momentum_only_with_each_other);
    RUN_TEST(test_firm_tyres_are_the_contact_without_slip);
    RUN_TEST(test_it_replaces_the_other_laws_of_a_tyre);
    RUN_TEST(test_paper_profile_and_motor_have_no_tyre);
    return UNITY_END();
}
