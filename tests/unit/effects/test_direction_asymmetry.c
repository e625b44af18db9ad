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

static double steady(double voltage)
{
    start(NULL);
    go(voltage, voltage, 10);
    return state()->wheel_speed[0];
}

static void test_dry_friction_is_on_one_side_only(void)
{
    on("direction_asymmetry", 0.005, 0, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, (6 * GAIN - 0.005) / EMF_LOSS, steady(6));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -6 * GAIN / EMF_LOSS, steady(-6));
    on("direction_asymmetry", -0.005, 0, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -(6 * GAIN - 0.005) / EMF_LOSS, steady(-6));
}

static void test_at_rest_it_holds_on_that_side_and_pushes_nowhere(void)
{
    const double hold = 0.005 / GAIN;
    on("direction_asymmetry", 0.005, 0, 0);
    TEST_ASSERT_TRUE(steady(0.999 * hold) == 0);
    TEST_ASSERT_TRUE(steady(0.001 * hold) == 0);
    TEST_ASSERT_TRUE(steady(1.01 * hold) > 1e-3);
    TEST_ASSERT_TRUE(steady(-0.01 * hold) < -1e-3);
}

static void test_drag_differs_by_direction(void)
{
    set("viscous_friction", 1e-3);
    on("direction_asymmetry", 0, 8e-4, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 6 * GAIN / (EMF_LOSS + 1.4e-3), steady(6));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -6 * GAIN / (EMF_LOSS + 0.6e-3), steady(-6));
}

static void test_gain_differs_by_direction_of_the_voltage(void)
{
    on("direction_asymmetry", 0, 0, 0.1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 6 * 1.05 * GAIN / EMF_LOSS, steady(6));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -6 * 0.95 * GAIN / EMF_LOSS, steady(-6));
    go(NAN, NAN, BODY_STEP);
    TEST_ASSERT_TRUE(state()->current[0] == 0);
}

static void test_reversed_it_drives_backward_as_forward(void)
{
    set("viscous_friction", 1e-3);
    on("direction_asymmetry", 0.004, 5e-4, 0.06);
    const double forward = steady(5);
    on("direction_asymmetry", -0.004, -5e-4, -0.06);
    TEST_ASSERT_TRUE(forward == -steady(-5));
}

static void test_a_linear_axis_has_it_in_newton(void)
{
    axis();
    set("viscous_friction", 200);
    on("direction_asymmetry", 8, 40, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, (100 - 8) / 220.0, steady(2));
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, -100 / 180.0, steady(-2));
}

static void test_without_difference_it_is_off(void)
{
    assert_off("direction_asymmetry", 0, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_dry_friction_is_on_one_side_only);
    RUN_TEST(test_at_rest_it_holds_on_that_side_and_pushes_nowhere);
    RUN_TEST(test_drag_differs_by_direction);
    RUN_TEST(test_gain_differs_by_direction_of_the_voltage);
    RUN_TEST(test_reversed_it_drives_backward_as_forward);
    RUN_TEST(test_a_linear_axis_has_it_in_newton);
    RUN_TEST(test_without_difference_it_is_off);
    return UNITY_END();
}
