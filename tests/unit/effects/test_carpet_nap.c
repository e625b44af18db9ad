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

static const double FORCE = 0.5;

/* Returns the speed lost in 0.3 s at an angle to the lean of the pile, which points to (0.6, 0.8). */
static double loss(double angle)
{
    const bp_state moving = {.surge = 0.5, .heading = atan2(0.8, 0.6) + angle};
    on("carpet_nap", 0.6 * FORCE, 0.8 * FORCE, 0);
    start(&moving);
    go(NAN, NAN, 0.3);
    return 0.5 - state()->surge;
}

static void test_drag_depends_on_the_angle_to_the_pile(void)
{
    const double most = FORCE / surge_mass() * 0.3;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, loss(0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, most, loss(3.141592653589793));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * most, loss(1.5707963267948966));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, loss(-0.7), loss(0.7));
}

static void test_it_moves_nothing_that_rests(void)
{
    on("carpet_nap", 0.6 * FORCE, 0.8 * FORCE, 0);
    for (int i = 0; i < 8; i++) {
        const bp_state turned = {.heading = i};
        start(&turned);
        go(NAN, NAN, 0.3);
        TEST_ASSERT_TRUE(state()->surge == 0);
    }
}

static void test_across_the_pile_it_pulls_sideways_where_tyres_give_way(void)
{
    on("carpet_nap", 0, FORCE, 0);
    on("side_slip", 0.5, 1, 0);
    coast(0.5, 0, 3 * BODY_STEP);
    TEST_ASSERT_TRUE(state()->sway > 1e-4);
}

static void test_a_force_of_zero_is_off_and_a_motor_is_not_on_it(void)
{
    assert_off("carpet_nap", 0, 0, 0);
    assert_not_of_a_motor("carpet_nap", 0.3, 0.4, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_drag_depends_on_the_angle_to_the_pile);
    RUN_TEST(test_it_moves_nothing_that_rests);
    RUN_TEST(test_across_the_pile_it_pulls_sideways_where_tyres_give_way);
    RUN_TEST(test_a_force_of_zero_is_off_and_a_motor_is_not_on_it);
    return UNITY_END();
}
