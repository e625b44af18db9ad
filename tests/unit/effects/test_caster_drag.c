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

static const double FORCE = 0.6, FORWARD = -0.09;

static void use(void)
{
    on("caster_drag", FORCE, FORWARD, 0);
}

static void test_straight_ahead_all_of_it_brakes(void)
{
    use();
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(sign * 0.5, 0, 0.3);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, sign * (0.5 - FORCE / surge_mass() * 0.3), state()->surge);
    }
}

static void test_on_the_spot_it_brakes_with_its_lever(void)
{
    use();
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(0, sign * 4.0, 0.15);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, sign * (4 - FORCE * 0.09 / turn_inertia() * 0.15), state()->yaw_rate);
    }
}

static void test_in_a_curve_it_points_against_the_ball_s_velocity(void)
{
    const double along = 0.4, across = 3 * FORWARD, speed = sqrt(along * along + across * across);
    use();
    coast(along, 3, BODY_STEP);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, along - BODY_STEP * FORCE * along / speed / surge_mass(), state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 3 - BODY_STEP * FORCE * FORWARD * FORWARD * 3 / speed / turn_inertia(),
                              state()->yaw_rate);
}

static void test_it_holds_a_vehicle_at_rest(void)
{
    use();
    start(NULL);
    const double hold = 0.5 * FORCE * RADIUS / GAIN;
    go(0.999 * hold, 0.999 * hold, 1);
    TEST_ASSERT_TRUE(state()->x == 0);
    go(1.01 * hold, 1.01 * hold, 1);
    TEST_ASSERT_TRUE(state()->surge > 1e-3);
}

static void test_it_brings_a_curve_to_rest_for_good(void)
{
    use();
    coast(0.3, 3, 2);
    const bp_state stopped = *state();
    TEST_ASSERT_TRUE(stopped.surge == 0 && stopped.yaw_rate == 0);
    go(NAN, NAN, 1);
    TEST_ASSERT_TRUE(stopped.x == state()->x && stopped.heading == state()->heading);
}

static void test_paper_profile_brakes_the_body(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    use();
    coast(0.5, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 - FORCE / MASS * 0.3, state()->surge);
    coast(0.5, 0, 3);
    TEST_ASSERT_TRUE(state()->surge == 0);
}

static void test_a_force_of_zero_is_off_and_a_motor_has_no_caster(void)
{
    assert_off("caster_drag", 0, FORWARD, 0);
    assert_not_of_a_motor("caster_drag", FORCE, FORWARD, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_straight_ahead_all_of_it_brakes);
    RUN_TEST(test_on_the_spot_it_brakes_with_its_lever);
    RUN_TEST(test_in_a_curve_it_points_against_the_ball_s_velocity);
    RUN_TEST(test_it_holds_a_vehicle_at_rest);
    RUN_TEST(test_it_brings_a_curve_to_rest_for_good);
    RUN_TEST(test_paper_profile_brakes_the_body);
    RUN_TEST(test_a_force_of_zero_is_off_and_a_motor_has_no_caster);
    return UNITY_END();
}
