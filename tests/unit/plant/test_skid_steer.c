#include <string.h>

#include "../effects/drive.h"

static const double FRICTION = 0.3, SLIP_SPEED = 0.01, ARM = 0.07; /* presets; half of the wheelbase */

void setUp(void)
{
    vehicle(BP_SKID_STEER, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

/* Both wheels of a side bear (friction m g / 2) s / sqrt(slip_speed^2 + s^2) together. */
static void test_straight_ahead_no_contact_slips_sideways(void)
{
    on("quadratic_drag", 6, 0, 0);
    start(NULL);
    go(9, 9, 10);
    const double force = 0.5 * 6 * state()->surge * state()->surge, most = FRICTION * 0.5 * MASS * GRAVITY;
    const double share = force / most;
    TEST_ASSERT_TRUE(force > 0.2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, SLIP_SPEED * share / sqrt(1 - share * share),
                              RADIUS * state()->wheel_speed[0] - state()->surge);
    TEST_ASSERT_EQUAL_DOUBLE(0, state()->sway);
    TEST_ASSERT_EQUAL_DOUBLE(0, state()->yaw_rate);
    TEST_ASSERT_EQUAL_DOUBLE(state()->wheel_speed[0], state()->wheel_speed[1]);
}

/* Returns the moment over a short step on a body that turns at `rate` on wheels too heavy to change their speed. */
static double moment(double rate, double rim_speed)
{
    const bp_state turning = {.yaw_rate = rate, .wheel_speed = {rim_speed / RADIUS, -rim_speed / RADIUS}};
    set("wheel_inertia", 1e4);
    start(&turning);
    const double input[2] = {NAN, NAN}, step = 1e-5;
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, step));
    return YAW_INERTIA * (state()->yaw_rate - rate) / step;
}

/* A fast turn drags every contact with all that it bears: sideways alone where the wheels roll along, and against the
 * whole radius where they are locked. */
static void test_a_fast_turn_meets_coulomb_friction_of_four_contacts(void)
{
    const double weight = FRICTION * MASS * GRAVITY;
    for (int sign = -1; sign <= 1; sign += 2) {
        TEST_ASSERT_DOUBLE_WITHIN(2e-3 * weight * ARM, -sign * weight * ARM, moment(sign * 20, sign * 20 * HALF_TRACK));
        const double whole = weight * sqrt(ARM * ARM + HALF_TRACK * HALF_TRACK);
        TEST_ASSERT_DOUBLE_WITHIN(2e-3 * whole, -sign * whole, moment(sign * 20, 1e-12));
    }
}

/* friction m g arm^2 rate / slip_speed. */
static void test_a_slow_turn_meets_a_moment_in_proportion(void)
{
    const double rate = 1e-3, expected = FRICTION * MASS * GRAVITY * ARM * ARM * rate / SLIP_SPEED;
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * expected, -expected, moment(rate, rate * HALF_TRACK));
}

static double energy(void)
{
    const bp_state *s = state();
    return 0.5 * MASS * (s->surge * s->surge + s->sway * s->sway) + 0.5 * YAW_INERTIA * s->yaw_rate * s->yaw_rate +
           0.5 * WHEEL_INERTIA * (s->wheel_speed[0] * s->wheel_speed[0] + s->wheel_speed[1] * s->wheel_speed[1]);
}

static void test_the_floor_never_gives_energy(void)
{
    for (int i = 0; i < 64; i++) {
        const bp_state sliding = {.surge = 0.4 * sin(i),
                                  .sway = 0.5 * sin(2.3 * i),
                                  .yaw_rate = 9 * cos(1.7 * i),
                                  .wheel_speed = {20 * sin(3.1 * i + 1), 20 * cos(4.7 * i)}};
        start(&sliding);
        double before = energy();
        for (int k = 0; k < 200; k++) {
            go(NAN, NAN, BODY_STEP);
            TEST_ASSERT_TRUE(energy() <= before * (1 + 1e-12) + 1e-30);
            before = energy();
        }
    }
}

static bp_state winding(double left, double right)
{
    start(NULL);
    go(left, right, 0.9);
    go(right, -left, 0.6);
    return *state();
}

static void test_left_and_right_are_alike(void)
{
    const bp_state one = winding(7, 3), other = (start(NULL), go(3, 7, 0.9), go(-7, 3, 0.6), *state());
    TEST_ASSERT_TRUE(fabs(one.heading) > 0.3 && fabs(one.sway) > 1e-3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, one.heading, -other.heading);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, one.sway, -other.sway);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, one.x, other.x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, one.wheel_angle[0], other.wheel_angle[1]);
}

/* In a steady spin the forces along the track balance those across it, so the slips stand as the arms: the wheels roll
 * 1 + (wheelbase / (2 half_track))^2 times as far as the body turns. */
static void test_it_turns_as_if_its_track_were_wider(void)
{
    set("wheelbase", 0.12);
    start(NULL);
    go(9, -9, 3);
    const double rolled = RADIUS * (state()->wheel_speed[0] - state()->wheel_speed[1]) / (2 * HALF_TRACK);
    TEST_ASSERT_TRUE(state()->yaw_rate > 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1 + 0.06 * 0.06 / (HALF_TRACK * HALF_TRACK), rolled / state()->yaw_rate);
}

/* The contacts bear as much as the place of the centre of mass puts on them, so sliding sideways turns nothing. */
static void test_loads_follow_the_centre_of_mass(void)
{
    const bp_state sliding = {.sway = 0.5, .wheel_speed = {1e-12, 1e-12}, .surge = 1e-12};
    on("com_forward_offset", 0.03, 0, 0);
    on("com_lateral_offset", 0.02, 0, 0);
    start(&sliding);
    go(NAN, NAN, 0.03);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 0.5 - FRICTION * GRAVITY * 0.03, state()->sway);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 0, state()->yaw_rate);
}

static void test_it_takes_the_place_of_other_laws_of_tyres(void)
{
    const bp_state alone = winding(7, 3);
    on("tyre_grip", 0.3, 0.2, 0);
    on("side_slip", 0.3, 0.2, 0);
    const bp_state beside = winding(7, 3);
    TEST_ASSERT_EQUAL_MEMORY(&alone, &beside, sizeof alone);
}

static void test_long_motor_steps_follow(void)
{
    const bp_state fine = winding(7, 3);
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, NULL, 0.003, 0.003));
    go(7, 3, 0.9);
    go(3, -7, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, fine.wheel_angle[0], state()->wheel_angle[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, fine.heading, state()->heading);
}

static void test_no_other_vehicle_has_its_parameters(void)
{
    double value;
    TEST_ASSERT_EQUAL_INT(0, bp_model_get(model, "wheelbase", &value));
    TEST_ASSERT_EQUAL_DOUBLE(2 * ARM, value);
    TEST_ASSERT_NULL(bp_model_new(BP_SKID_STEER, BP_PAPER));
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
    TEST_ASSERT_EQUAL_INT(BP_E_NAME, bp_model_set(model, "wheelbase", 0.2));
    TEST_ASSERT_EQUAL_INT(BP_E_NAME, bp_model_get(model, "slip_speed", &value));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_straight_ahead_no_contact_slips_sideways);
    RUN_TEST(test_a_fast_turn_meets_coulomb_friction_of_four_contacts);
    RUN_TEST(test_a_slow_turn_meets_a_moment_in_proportion);
    RUN_TEST(test_the_floor_never_gives_energy);
    RUN_TEST(test_left_and_right_are_alike);
    RUN_TEST(test_it_turns_as_if_its_track_were_wider);
    RUN_TEST(test_loads_follow_the_centre_of_mass);
    RUN_TEST(test_it_takes_the_place_of_other_laws_of_tyres);
    RUN_TEST(test_long_motor_steps_follow);
    RUN_TEST(test_no_other_vehicle_has_its_parameters);
    return UNITY_END();
}
