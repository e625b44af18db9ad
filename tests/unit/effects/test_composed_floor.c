#include "composed.h"

static const double PI = 3.14159265358979323846;

/* A drive across the slope and along it, with the centre of mass beside the axle's middle. */
static void slanting_drive(double row[OUTPUT_COUNT])
{
    const bp_state slanting = {.heading = 0.8, .surge = 0.2};
    on("com_forward_offset", 0.02, 0, 0);
    on("com_lateral_offset", 0.01, 0, 0);
    start(&slanting);
    go(6, 3, 0.6);
    go(-3, 5, 0.6);
    memcpy(row, out, sizeof out);
}

static void test_a_long_wave_is_a_constant_slope(void)
{
    double constant[OUTPUT_COUNT], composed[OUTPUT_COUNT], level[OUTPUT_COUNT];
    slanting_drive(level);
    on("floor_slope", 0.04, 0, 0);
    slanting_drive(constant);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term("wavelength", 1000);
    term("floor_add_cos_x", 0.04);
    slanting_drive(composed);
    TEST_ASSERT_TRUE(fabs(constant[OUTPUT_ACCEL_SURGE] - level[OUTPUT_ACCEL_SURGE]) > 0.1);
    TEST_ASSERT_TRUE(fabs(constant[OUTPUT_ACCEL_SWAY] - level[OUTPUT_ACCEL_SWAY]) > 0.1);
    TEST_ASSERT_TRUE(fabs(constant[OUTPUT_YAW_RATE] - level[OUTPUT_YAW_RATE]) > 1e-3);
    for (int i = 0; i <= OUTPUT_WHEEL_VELOCITY_RIGHT; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-5, constant[i], composed[i], bp_output_name(i));
}

/* Work: m g times the fall. The wheels turn with it. */
static void test_a_vehicle_rolls_through_waves_and_keeps_its_energy(void)
{
    const double size = 0.05, length = 0.2, number = 2 * PI / length;
    term("wavelength", length);
    term("floor_add_sin_x", size);
    coast(0.8, 0, 0.9);
    const double fall = size / number * (1 - cos(number * state()->x));
    const double energy = 0.5 * surge_mass() * 0.8 * 0.8 + MASS * GRAVITY * fall;
    TEST_ASSERT_TRUE(fall > 1e-3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, sqrt(2 * energy / surge_mass()), state()->surge);
}

static void test_a_ramp_gives_the_energy_of_its_height(void)
{
    const double integral = PI / 4 / sin(PI / 8); /* of 1 / (1 + z^8) */
    term("patch_x", 0.5);
    term("patch_half_width", 0.1);
    term("floor_add_patch", 0.05);
    coast(0.8, 0, 1.2);
    const double energy = 0.5 * surge_mass() * 0.8 * 0.8 + MASS * GRAVITY * 0.05 * 0.1 * integral;
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, sqrt(2 * energy / surge_mass()), state()->surge);
}

/* At rest and held by friction, accelerometers show the floor's reaction where the vehicle stands. */
static void test_accelerometers_at_rest_show_where_on_the_wave_they_stand(void)
{
    const bp_state crosswise = {.heading = PI / 2, .x = 0.05};
    on("coulomb_friction", 0.05, 0, 0);
    term("wavelength", 0.2);
    term("floor_add_sin_x", 0.04);
    start(&(bp_state){.x = 0.05});
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.04 * GRAVITY, out[OUTPUT_ACCEL_SURGE]);
    go(0, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.04 * GRAVITY, out[OUTPUT_ACCEL_SURGE]);
    start(&crosswise);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, out[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.04 * GRAVITY, out[OUTPUT_ACCEL_SWAY]);
}

/* What moves with gravity feels nothing; what a force of the same size moves, does. */
static void test_rolling_freely_over_waves_they_show_nothing_along(void)
{
    set("wheel_inertia", 1e-9);
    term("wavelength", 0.5);
    term("floor_add_sin_x", 0.1);
    coast(0.8, 0, 0.15);
    TEST_ASSERT_TRUE(fabs(plant.vehicle.accel_surge) > 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, out[OUTPUT_ACCEL_SURGE]);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    set("wheel_inertia", 1e-9);
    term("wavelength", 0.5);
    term("surge_push_sin_x", 0.1 * MASS * GRAVITY);
    coast(0.8, 0, 0.15);
    TEST_ASSERT_TRUE(fabs(out[OUTPUT_ACCEL_SURGE]) > 0.3);
}

/* Accelerations are means over the last body step, so the slope is that of its middle: at its end it would be off by
 * 0.015 m/s^2 where the vehicle crosses the waves, and by 0.004 m/s^2 where it turns. */
static void test_accelerometers_show_the_slope_in_the_middle_of_the_step(void)
{
    set("wheel_inertia", 1e-9);
    term("wavelength", 0.5);
    term("floor_add_sin_x", 0.1);
    coast(0.8, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, out[OUTPUT_ACCEL_SURGE]);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    set("wheel_inertia", 1e-9);
    term("wavelength", 1000);
    term("floor_add_cos_x", 0.1);
    coast(0, 3, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, out[OUTPUT_ACCEL_SURGE]);
}

/* What a sensor adds goes with the specific force, which has no share of gravity in it. */
static void test_an_accelerometer_s_error_goes_with_the_reaction_of_the_floor(void)
{
    on("coulomb_friction", 0.05, 0, 0);
    term("wavelength", 1000);
    term("floor_add_cos_x", 0.04);
    term("accel_surge_add_a", 0.1);
    start(NULL);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -1.1 * 0.04 * GRAVITY, out[OUTPUT_ACCEL_SURGE]);
}

static void test_a_slope_is_no_steeper_than_the_effect_may_be(void)
{
    on("coulomb_friction", 1000, 0, 0);
    term("wavelength", 1000);
    term("floor_add_cos_x", 0.7);
    term("floor_add_patch", 0.7);
    start(&(bp_state){.x = 0.5});
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.7 * GRAVITY, out[OUTPUT_ACCEL_SURGE]);
}

static void test_a_motor_stands_on_no_floor(void)
{
    presets();
    axis();
    start(NULL);
    go(2, 0, 0.6);
    const bp_state plain = *state();
    term("floor_add_cos_x", 0.3);
    start(NULL);
    go(2, 0, 0.6);
    TEST_ASSERT_EQUAL_MEMORY(&plain, state(), sizeof plain);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_long_wave_is_a_constant_slope);
    RUN_TEST(test_a_vehicle_rolls_through_waves_and_keeps_its_energy);
    RUN_TEST(test_a_ramp_gives_the_energy_of_its_height);
    RUN_TEST(test_accelerometers_at_rest_show_where_on_the_wave_they_stand);
    RUN_TEST(test_rolling_freely_over_waves_they_show_nothing_along);
    RUN_TEST(test_accelerometers_show_the_slope_in_the_middle_of_the_step);
    RUN_TEST(test_an_accelerometer_s_error_goes_with_the_reaction_of_the_floor);
    RUN_TEST(test_a_slope_is_no_steeper_than_the_effect_may_be);
    RUN_TEST(test_a_motor_stands_on_no_floor);
    return UNITY_END();
}
