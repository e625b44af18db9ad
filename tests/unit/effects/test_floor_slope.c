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

static const double QUARTER = 1.5707963267948966;

static void test_downhill_it_gains_speed(void)
{
    on("floor_slope", 0.04, 0, 0);
    coast(0, 0, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.04 * GRAVITY * MASS / surge_mass() * 0.6, state()->surge);
}

static void test_slope_stays_where_the_earth_is(void)
{
    const bp_state right = {.heading = QUARTER}, back = {.heading = 2 * QUARTER};
    on("floor_slope", 0.04, 0.03, 0);
    start(&right);
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.03 * GRAVITY * MASS / surge_mass() * 0.6, state()->surge);
    start(&back);
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -0.04 * GRAVITY * MASS / surge_mass() * 0.6, state()->surge);
}

static void test_accelerometers_at_rest_show_the_floor_s_reaction(void)
{
    on("floor_slope", 0.04, 0.03, 0);
    on("coulomb_friction", 0.05, 0, 0);
    coast(0, 0, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.04 * GRAVITY, out[OUTPUT_ACCEL_SURGE]);
    go(0, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.04 * GRAVITY, out[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.03 * GRAVITY, out[OUTPUT_ACCEL_SWAY]);
    TEST_ASSERT_TRUE(state()->x == 0);
}

static void test_rolling_freely_they_show_nothing_along(void)
{
    set("wheel_inertia", 1e-9);
    on("floor_slope", 0.04, 0.03, 0);
    coast(0, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0, out[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.03 * GRAVITY, out[OUTPUT_ACCEL_SWAY]);
}

/* J_z + m a^2 turns under m g slope_y a. */
static void test_the_heavy_end_turns_downhill(void)
{
    set("wheel_inertia", 1e-9);
    on("floor_slope", 0, 0.03, 0);
    on("com_forward_offset", 0.04, 0, 0);
    coast(0, 0, BODY_STEP);
    const double accel = MASS * GRAVITY * 0.03 * 0.04 / (YAW_INERTIA + MASS * 0.04 * 0.04);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, accel * BODY_STEP, state()->yaw_rate);
}

static void test_falling_freely_all_of_it_falls_alike(void)
{
    set("wheel_inertia", 1e-9);
    on("floor_slope", 0.04, 0, 0);
    on("com_lateral_offset", 0.04, 0, 0);
    coast(0, 0, BODY_STEP);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.04 * GRAVITY * BODY_STEP, state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0, state()->yaw_rate);
}

static void test_in_the_paper_profile_it_turns_nothing(void)
{
    vehicle(BP_DIFF_DRIVE, BP_PAPER);
    on("floor_slope", 0.04, 0.03, 0);
    on("com_forward_offset", 0.04, 0, 0);
    coast(0, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.3 * 0.04 * GRAVITY, state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.3 * 0.03 * GRAVITY, state()->sway);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, state()->yaw_rate);
}

static void test_a_level_floor_is_off_and_a_motor_is_not_on_it(void)
{
    assert_off("floor_slope", 0, 0, 0);
    assert_not_of_a_motor("floor_slope", 0.04, 0.03, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_downhill_it_gains_speed);
    RUN_TEST(test_slope_stays_where_the_earth_is);
    RUN_TEST(test_accelerometers_at_rest_show_the_floor_s_reaction);
    RUN_TEST(test_rolling_freely_they_show_nothing_along);
    RUN_TEST(test_the_heavy_end_turns_downhill);
    RUN_TEST(test_falling_freely_all_of_it_falls_alike);
    RUN_TEST(test_in_the_paper_profile_it_turns_nothing);
    RUN_TEST(test_a_level_floor_is_off_and_a_motor_is_not_on_it);
    return UNITY_END();
}
