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

static void assert_near(const bp_state *a, const bp_state *b)
{
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, a->surge, b->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, a->yaw_rate, b->yaw_rate);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, a->heading, b->heading);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, a->x, b->x);
}

static void test_above_the_axle_it_is_more_mass(void)
{
    set("rolling_friction", 0.015);
    on("payload_mass", 0.3, 0, 0);
    const bp_state loaded = tour();
    bp_model_remove_effect(model, "payload_mass");
    set("mass", MASS + 0.3);
    const bp_state heavier = tour();
    assert_near(&heavier, &loaded);
}

/* A load of a quarter of the mass moves the centre of mass by a quarter of its distance, and adds the inertia of the
 * reduced mass. */
static void test_elsewhere_it_moves_the_centre_of_mass_and_adds_inertia(void)
{
    on("payload_mass", 0.3, 0.08, 0.06);
    const bp_state loaded = tour();
    bp_model_remove_effect(model, "payload_mass");
    set("mass", 1.2);
    set("yaw_inertia", YAW_INERTIA + 0.75 * 0.3 * 0.01);
    on("com_forward_offset", 0.02, 0, 0);
    on("com_lateral_offset", 0.015, 0, 0);
    const bp_state same = tour();
    assert_near(&same, &loaded);
}

static void test_a_load_on_an_axis_is_more_mass(void)
{
    axis();
    on("payload_mass", 25, 0, 0);
    start(NULL);
    go(2, 0, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100.0 / 125 * 0.6, state()->wheel_speed[0]);
}

static void test_paper_profile_accelerates_less(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    start(NULL);
    go(6, 6, 0.3);
    const double empty = state()->surge;
    on("payload_mass", 0.9, 0, 0);
    start(NULL);
    go(6, 6, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * empty, state()->surge);
}

static void test_a_payload_of_zero_is_off(void)
{
    assert_off("payload_mass", 0, 0.1, 0.1);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_above_the_axle_it_is_more_mass);
    RUN_TEST(test_elsewhere_it_moves_the_centre_of_mass_and_adds_inertia);
    RUN_TEST(test_a_load_on_an_axis_is_more_mass);
    RUN_TEST(test_paper_profile_accelerates_less);
    RUN_TEST(test_a_payload_of_zero_is_off);
    return UNITY_END();
}
