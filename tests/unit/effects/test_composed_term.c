#include "composed.h"

static const double PI = 3.14159265358979323846;

/* A vehicle with losses, so that a term that takes losses away shows. */
static bp_state ride(double row[OUTPUT_COUNT])
{
    const bp_state waiting = {.age = 2};
    set("viscous_friction", 1e-3);
    start(&waiting);
    go(7, 4, 0.4);
    go(-3, 6, 0.4);
    go(NAN, -5, 0.2);
    go(6, 6, 0.2);
    memcpy(row, out, sizeof out);
    return *state();
}

static void test_a_bare_term_is_off(void)
{
    for (int profile = BP_COUPLED; profile <= BP_PAPER; profile++) {
        fresh(BP_DIFF_DRIVE, profile);
        const bp_state before = tour();
        TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "composed_term", values));
        const bp_state after = tour();
        TEST_ASSERT_EQUAL_MEMORY(&before, &after, sizeof before);
    }
}

static void test_the_table_is_whole(void)
{
    TEST_ASSERT_EQUAL_INT(COMPOSED_COUNT, info()->parameter_count);
    TEST_ASSERT_EQUAL_STRING("clock", info()->parameters[COMPOSED_COUNT - 1].name);
    for (int k = 0; k < COMPOSED_COUNT; k++) {
        const bp_parameter_info *parameter = &info()->parameters[k];
        for (int other = 0; other < k; other++)
            TEST_ASSERT_TRUE_MESSAGE(strcmp(parameter->name, info()->parameters[other].name) != 0, parameter->name);
        if (is_coefficient(parameter))
            TEST_ASSERT_TRUE_MESSAGE(strstr(parameter->meaning, " += ") && strchr(parameter->meaning, '[') &&
                                         strchr(parameter->meaning, ']'),
                                     parameter->meaning);
    }
}

static void test_every_term_shows(void)
{
    double plain[OUTPUT_COUNT], changed[OUTPUT_COUNT];
    ride(plain);
    for (int k = 0; k < COMPOSED_COUNT; k++) {
        const bp_parameter_info *parameter = &info()->parameters[k];
        if (!is_coefficient(parameter))
            continue;
        fresh(BP_DIFF_DRIVE, BP_COUPLED);
        term(parameter->name, 0.01);
        ride(changed);
        double most = 0;
        for (int i = 0; i < OUTPUT_COUNT; i++)
            most = fmax(most, fabs(changed[i] - plain[i]));
        TEST_ASSERT_TRUE_MESSAGE(most > 1e-5, parameter->name);
    }
}

/* Swapping left and right and the sign of an odd term gives the mirror image. Each term acts alone, at a visible
 * size. */
static void test_every_term_has_its_mirror_image(void)
{
    static const output_t EVEN[] = {OUTPUT_ACCEL_SURGE, OUTPUT_X, OUTPUT_SURGE};
    static const output_t ODD[] = {OUTPUT_ACCEL_SWAY, OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE, OUTPUT_Y};
    for (int k = 0; k < COMPOSED_COUNT; k++) {
        const bp_parameter_info *parameter = &info()->parameters[k];
        double row[2][OUTPUT_COUNT];
        for (int mirrored = 0; mirrored < 2 && is_coefficient(parameter); mirrored++) {
            fresh(BP_DIFF_DRIVE, BP_COUPLED);
            term(parameter->name, mirrored && parameter->odd ? -0.02 : 0.02);
            start(NULL);
            go(mirrored ? 4 : 7, mirrored ? 7 : 4, 0.4);
            go(mirrored ? 6 : -3, mirrored ? -3 : 6, 0.4);
            go(mirrored ? -5 : NAN, mirrored ? NAN : -5, 0.2);
            memcpy(row[mirrored], out, sizeof out);
        }
        for (size_t i = 0; i < sizeof EVEN / sizeof EVEN[0] && is_coefficient(parameter); i++)
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-9, row[0][EVEN[i]], row[1][EVEN[i]], parameter->name);
        for (size_t i = 0; i < sizeof ODD / sizeof ODD[0] && is_coefficient(parameter); i++)
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-9, row[0][ODD[i]], -row[1][ODD[i]], parameter->name);
        for (int i = OUTPUT_WHEEL_SPEED_LEFT; i <= OUTPUT_WHEEL_VELOCITY_RIGHT && is_coefficient(parameter); i += 2) {
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-9, row[0][i], row[1][i + 1], parameter->name);
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-9, row[0][i + 1], row[1][i], parameter->name);
        }
    }
}

/* Any coefficient, with either sign and a hundred times a visible size, damps or drives, and the state stays finite. */
static void test_absurd_sizes_stay_finite(void)
{
    for (int k = 0; k < COMPOSED_COUNT; k++) {
        const bp_parameter_info *parameter = &info()->parameters[k];
        for (int sign = -1; sign <= 1 && is_coefficient(parameter); sign += 2) {
            double row[OUTPUT_COUNT];
            fresh(BP_DIFF_DRIVE, BP_COUPLED);
            term(parameter->name, fmin(fmax(sign * 1.0, parameter->minimum), parameter->maximum));
            ride(row);
            TEST_ASSERT_TRUE_MESSAGE(isfinite(row[OUTPUT_YAW_RATE]) && isfinite(row[OUTPUT_X]), parameter->name);
        }
    }
}

static void assert_same_as(const char *effect, double size, const char *name, double coefficient, double within)
{
    double composed[OUTPUT_COUNT], named[OUTPUT_COUNT];
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term(name, coefficient);
    ride(composed);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    on(effect, size, 1, 0);
    ride(named);
    for (int i = 0; i <= OUTPUT_WHEEL_ANGLE_RIGHT; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(within, named[i], composed[i], name);
}

static void test_terms_that_have_a_name_agree_with_it(void)
{
    assert_same_as("coulomb_friction", 0.006, "wheel_dry_constant", 0.006, 0);
    assert_same_as("rolling_sqrt", 0.002, "wheel_dry_root_w", 0.002, 0);
    assert_same_as("quadratic_drag", 0.5, "surge_loss_abs_u", 0.5, 0);
    assert_same_as("surge_drag", 0.5, "surge_loss_linear", 0.5, 0);
    assert_same_as("viscous_scrub", 0.005, "yaw_loss_linear", 0.005, 0);
    assert_same_as("viscous_loss", 4e-4, "wheel_loss_linear", 4e-4, 0);
    assert_same_as("yaw_scrub", 0.012, "yaw_dry_constant", 0.012, 0);
    assert_same_as("cogging", 0.01, "wheel_push_sin_angle", -0.01, 1e-12);
}

/* The law must hold in the middle of a step, not at its start. */
static void test_a_cubic_drag_slows_as_one_over_the_root_of_time(void)
{
    term("surge_loss_u2", 3);
    coast(0.8, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.8 / sqrt(1 + 2 * 3 * 0.8 * 0.8 * 0.9 / surge_mass()), state()->surge);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term("wheel_loss_w2", 2e-6);
    coast(0.8, 0, 0.9);
    const double speed = 0.8 / RADIUS, inertia = surge_mass() * RADIUS * RADIUS / 2;
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.8 / sqrt(1 + 2 * 2e-6 * speed * speed * 0.9 / inertia), state()->surge);
}

static void test_a_loss_even_in_the_speed_brakes_one_way_and_gives_nothing_the_other(void)
{
    term("surge_loss_u", 2);
    coast(0.8, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.8 / (1 + 2 * 0.8 * 0.9 / surge_mass()), state()->surge);
    coast(-0.8, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.8, state()->surge);
}

static void test_negative_losses_take_away_no_more_than_there_are(void)
{
    static const char *const NAME[] = {"wheel_loss_abs_w",  "surge_loss_abs_u",  "yaw_loss_abs_r",
                                       "wheel_loss_linear", "surge_loss_linear", "yaw_loss_linear"};
    for (size_t i = 0; i < sizeof NAME / sizeof NAME[0]; i++) {
        fresh(BP_DIFF_DRIVE, BP_COUPLED);
        set("viscous_friction", 1e-3);
        term(NAME[i], -100);
        coast(0, 3, 0.3);
        const double yaw_kept = state()->yaw_rate / 3;
        coast(0.5, 0, 0.3);
        const double surge_kept = state()->surge / 0.5;
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1, fmax(yaw_kept, surge_kept));
    }
}

static void test_a_gain_is_that_of_other_voltages(void)
{
    double plain[OUTPUT_COUNT];
    start(NULL);
    go(5 + 0.02 * 25 + 0.001 * 125, -(3 + 0.02 * 9 + 0.001 * 27), 0.6);
    memcpy(plain, out, sizeof out);
    term("drive_gain_v", 0.02);
    term("drive_gain_v2", 0.001);
    start(NULL);
    go(5, -3, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, plain[OUTPUT_YAW_RATE], out[OUTPUT_YAW_RATE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, plain[OUTPUT_SURGE], out[OUTPUT_SURGE]);
}

static void test_a_gain_at_most_doubles_and_a_floating_motor_floats(void)
{
    start(NULL);
    go(6, NAN, 0.6);
    const bp_state doubled = *state();
    term("drive_gain_v", 50);
    start(NULL);
    go(3, NAN, 0.6);
    TEST_ASSERT_EQUAL_MEMORY(&doubled, state(), sizeof doubled);
}

static void test_crosstalk_adds_a_share_of_the_other_voltage(void)
{
    start(NULL);
    go(5 + 0.1 * 2, 2 + 0.1 * 5, 0.6);
    const bp_state plain = *state();
    term("drive_add_other", 0.1);
    start(NULL);
    go(5, 2, 0.6);
    TEST_ASSERT_EQUAL_MEMORY(&plain, state(), sizeof plain);
}

static void test_a_difference_is_more_at_the_left_and_less_at_the_right(void)
{
    start(NULL);
    go(5 * (1 + 0.02 * 5), 3 * (1 - 0.02 * 3), 0.6);
    const bp_state plain = *state();
    term("drive_gain_diff_v", 0.02);
    start(NULL);
    go(5, 3, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, plain.yaw_rate, state()->yaw_rate);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, plain.surge, state()->surge);
}

static void test_a_saturating_magnet_lowers_the_standing_torque(void)
{
    set("inductance", 0);
    set("emf_constant", 0);
    term("wheel_gain_i", -0.5);
    start(NULL);
    go(6, 6, 0.3);
    const double current = 6.0 / 22, torque = 0.195 * current * (1 - 0.5 * current);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4, 0.3 * 2 * torque / RADIUS / surge_mass(), state()->surge);
}

static void test_a_force_periodic_in_time_moves_a_free_vehicle(void)
{
    const double p = 2 * PI * 1.7;
    term("frequency", 1.7);
    term("surge_push_sin_time", 0.5);
    coast(0, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.5 / (surge_mass() * p) * (1 - cos(p * 0.9)), state()->surge);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term("frequency", 1.7);
    term("yaw_push_cos_time", 0.01);
    coast(0, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.01 / (turn_inertia() * p) * sin(p * 0.9), state()->yaw_rate);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term("frequency", 1.7);
    term("wheel_push_sin_time", 0.01);
    coast(0, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 2 * 0.01 / RADIUS / (surge_mass() * p) * (1 - cos(p * 0.9)), state()->surge);
}

static void test_time_counts_from_the_run_s_start_or_from_power_on(void)
{
    const bp_state later = {.age = 20};
    term("surge_push_t", 0.2);
    start(&later);
    go(NAN, NAN, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.2 * 0.9 * 0.9 / 2 / surge_mass(), state()->surge);
    term("clock", 1);
    start(&later);
    go(NAN, NAN, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.2 * (20 * 0.9 + 0.9 * 0.9 / 2) / surge_mass(), state()->surge);
}

static void test_a_patch_gives_its_work_to_what_crosses_it(void)
{
    const double integral = PI / 4 / sin(PI / 8); /* of 1 / (1 + z^8) */
    term("patch_x", 0.5);
    term("patch_half_width", 0.1);
    term("surge_push_patch", 0.4);
    coast(0.8, 0, 1.2);
    const double energy = 0.5 * surge_mass() * 0.8 * 0.8 + 0.4 * 0.1 * integral;
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, sqrt(2 * energy / surge_mass()), state()->surge);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term("patch_x", 0.5);
    term("patch_half_width", 0.1);
    term("surge_dry_patch", 0.4);
    coast(0.8, 0, 1.2);
    const double less = 0.5 * surge_mass() * 0.8 * 0.8 - 0.4 * 0.1 * integral;
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, sqrt(2 * less / surge_mass()), state()->surge);
}

static void test_bumps_give_back_what_they_took(void)
{
    term("wavelength", 0.2);
    term("surge_push_sin_x", 1);
    coast(0.8, 0, 0.9);
    const double rise = 1 * 0.2 / (2 * PI) * (1 - cos(2 * PI * state()->x / 0.2));
    const double energy = 0.5 * surge_mass() * 0.8 * 0.8 + rise;
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, sqrt(2 * energy / surge_mass()), state()->surge);
}

static void test_a_tether_makes_the_vehicle_swing_about_the_origin(void)
{
    term("surge_push_tether", 40);
    const double p = sqrt(40 / surge_mass());
    coast(0.3, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.3 / p * sin(p * 0.9), state()->x);
}

/* m u' = F + m_s (p^2 z), z'' = -p^2 z - u'. */
static void test_a_sprung_mass_swings_against_the_vehicle(void)
{
    const double mass = surge_mass(), load = 0.3, p = 2 * PI * 2, force = 0.5, t = 0.9;
    term("frequency", 2);
    term("damping", 0);
    term("surge_push_sprung", load);
    term("surge_push_constant", force);
    coast(0, 0, t);
    const double q = p * sqrt(1 + load / mass);
    const double back = load * p * p * force / (mass * mass * q * q) * (t - sin(q * t) / q);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3 * force * t / mass, force * t / mass - back, state()->surge);
}

static void test_a_heading_force_has_its_direction_over_ground(void)
{
    const bp_state turned = {.heading = 0.5};
    term("surge_push_cos_heading", 0.3);
    term("surge_push_sin_heading", 0.2);
    start(&turned);
    go(NAN, NAN, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.6 * (0.3 * cos(0.5) + 0.2 * sin(0.5)) / surge_mass(), state()->surge);
}

static void test_a_motor_feels_its_drive_its_wheel_and_its_load(void)
{
    presets();
    axis();
    term("wheel_push_spring", 400);
    start(NULL);
    go(2, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 100.0 / 400 * (1 - cos(2 * 0.9)), state()->wheel_angle[0]);
    presets();
    axis();
    term("surge_push_tether", 400);
    start(NULL);
    go(2, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 100.0 / 400 * (1 - cos(2 * 0.9)), state()->wheel_angle[0]);
    presets();
    axis();
    term("drive_gain_diff_v", 0.1);
    term("wheel_dry_diff_constant", 10);
    term("yaw_push_constant", 10);
    term("gyro_add_u", 10);
    term("encoder_gain_one", 10);
    start(NULL);
    go(2, 0, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.9, state()->wheel_speed[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_bare_term_is_off);
    RUN_TEST(test_the_table_is_whole);
    RUN_TEST(test_every_term_shows);
    RUN_TEST(test_every_term_has_its_mirror_image);
    RUN_TEST(test_absurd_sizes_stay_finite);
    RUN_TEST(test_terms_that_have_a_name_agree_with_it);
    RUN_TEST(test_a_cubic_drag_slows_as_one_over_the_root_of_time);
    RUN_TEST(test_a_loss_even_in_the_speed_brakes_one_way_and_gives_nothing_the_other);
    RUN_TEST(test_negative_losses_take_away_no_more_than_there_are);
    RUN_TEST(test_a_gain_is_that_of_other_voltages);
    RUN_TEST(test_a_gain_at_most_doubles_and_a_floating_motor_floats);
    RUN_TEST(test_crosstalk_adds_a_share_of_the_other_voltage);
    RUN_TEST(test_a_difference_is_more_at_the_left_and_less_at_the_right);
    RUN_TEST(test_a_saturating_magnet_lowers_the_standing_torque);
    RUN_TEST(test_a_force_periodic_in_time_moves_a_free_vehicle);
    RUN_TEST(test_time_counts_from_the_run_s_start_or_from_power_on);
    RUN_TEST(test_a_patch_gives_its_work_to_what_crosses_it);
    RUN_TEST(test_bumps_give_back_what_they_took);
    RUN_TEST(test_a_tether_makes_the_vehicle_swing_about_the_origin);
    RUN_TEST(test_a_sprung_mass_swings_against_the_vehicle);
    RUN_TEST(test_a_heading_force_has_its_direction_over_ground);
    RUN_TEST(test_a_motor_feels_its_drive_its_wheel_and_its_load);
    return UNITY_END();
}
