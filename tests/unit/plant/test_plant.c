#include <math.h>
#include <string.h>

#include "plant/plant.h"
#include "unity.h"

static const double RPM = 6.283185307179586 / 60;
static const double STEP = 0.003;

static bp_model *model;
static plant_t plant;

void setUp(void)
{
    model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
}

static void set(const char *name, double value)
{
    TEST_ASSERT_EQUAL_INT(0, bp_model_set(model, name, value));
}

static double get(const char *name)
{
    double value = NAN;
    TEST_ASSERT_EQUAL_INT(0, bp_model_get(model, name, &value));
    return value;
}

static const bp_state *state(void)
{
    return &plant.vehicle.state;
}

static void start(const bp_state *initial)
{
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, initial, 0, 0));
}

static void go(double left, double right, double seconds)
{
    const double input[2] = {left, right};
    for (int i = 0; i < (int)(seconds / STEP + 0.5); i++)
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, STEP));
}

static void other_profile(int profile)
{
    bp_model_free(model);
    model = bp_model_new(BP_DIFF_DRIVE, profile);
}

static void test_no_load_speed_is_345_to_351_rpm_at_9_v(void)
{
    set("rolling_friction", 0);
    set("drag_area", 0);
    start(NULL);
    go(9, 9, 20);
    TEST_ASSERT_DOUBLE_WITHIN(3 * RPM, 348 * RPM, state()->wheel_speed[0]);
}

static void test_steady_speed_balances_motor_and_losses(void)
{
    set("drag_area", 0);
    start(NULL);
    go(6, 6, 20);
    const double radius = get("wheel_radius");
    const double loss =
        get("viscous_friction") + get("mass") * get("gravity") * get("rolling_friction") * radius * radius;
    const double gain = get("torque_constant") / get("resistance");
    const double speed = 6 * gain / (loss + gain * get("emf_constant"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * speed, speed, state()->wheel_speed[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * speed, radius * speed, state()->surge);
}

static void test_steady_speed_with_air_drag_balances_the_square(void)
{
    set("rolling_friction", 0);
    set("drag_area", 0.5);
    start(NULL);
    go(6, 6, 20);
    const double w = state()->wheel_speed[0], u = state()->surge;
    const double torque = get("torque_constant") * state()->current[0] - get("viscous_friction") * w;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * 1.2 * 0.5 * u * u, 2 * torque / get("wheel_radius"));
}

/* Without inductance and drag the modes are of first order: after one time constant the speed is 1 - 1/e of its end. */
static void assert_time_constant(double sign, double inertia)
{
    set("inductance", 0);
    set("drag_area", 0);
    const double radius = get("wheel_radius");
    const double loss = get("viscous_friction") +
                        get("mass") * get("gravity") * get("rolling_friction") * radius * radius +
                        get("torque_constant") * get("emf_constant") / get("resistance");
    const double tau = inertia / loss, end = 5 * get("torque_constant") / get("resistance") / loss;
    const double input[2] = {5, 5 * sign};
    start(NULL);
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, tau));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6 * end, end * (1 - exp(-1)), state()->wheel_speed[0]);
}

static void test_straight_time_constant_has_half_the_mass_on_each_wheel(void)
{
    const double radius = get("wheel_radius");
    assert_time_constant(1, get("wheel_inertia") + 0.5 * get("mass") * radius * radius);
}

static void test_spin_time_constant_has_the_yaw_inertia(void)
{
    const double ratio = get("wheel_radius") / get("half_track");
    assert_time_constant(-1, get("wheel_inertia") + 0.5 * get("yaw_inertia") * ratio * ratio);
}

/* The energy from the drive = heat in the windings + friction + air drag + kinetic energy + energy in the coils. */
static void test_energy_balance_holds(void)
{
    set("drag_area", 0.2);
    const double b = get("viscous_friction") + 0.9 * 9.81 * 0.015 * 0.0408 * 0.0408;
    double fed = 0, lost = 0;
    start(NULL);
    for (int i = 0; i < 20000; i++) {
        const double input[2] = {i < 10000 ? 9 : -3, i < 10000 ? 5 : 6};
        const bp_state before = *state();
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, 1e-4));
        for (int k = 0; k < 2; k++) {
            const double current = 0.5 * (before.current[k] + state()->current[k]);
            const double speed = 0.5 * (before.wheel_speed[k] + state()->wheel_speed[k]);
            fed += 1e-4 * input[k] * current;
            /* The motor's own conversion loses (K_e - K_t) i w. */
            lost += 1e-4 * (22 * current * current + b * speed * speed + (0.245 - 0.195) * current * speed);
        }
        const double u = 0.5 * (before.surge + state()->surge);
        lost += 1e-4 * 0.5 * 1.2 * 0.2 * fabs(u * u * u);
    }
    double held = 0.5 * 0.9 * state()->surge * state()->surge + 0.5 * 0.006 * state()->yaw_rate * state()->yaw_rate;
    for (int k = 0; k < 2; k++)
        held += 0.5 * 1e-4 * state()->wheel_speed[k] * state()->wheel_speed[k] +
                0.5 * 0.01 * state()->current[k] * state()->current[k];
    TEST_ASSERT_TRUE(fed > 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4 * fed, fed, lost + held);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, fed, 9 * state()->charge);
}

static void drive_both_ways(int profile, const double swap[2], bp_state *first, bp_state *second)
{
    other_profile(profile);
    const double torque = 0.004;
    bp_model_add_effect(model, "coulomb_friction", &torque);
    start(NULL);
    go(5, 3, 0.6);
    go(-2, 7, 0.6);
    *first = *state();
    start(NULL);
    for (int i = 0; i < 2; i++) {
        const double a = i == 0 ? 5 : -2, b = i == 0 ? 3 : 7;
        if (swap[0] > 0)
            go(swap[1] * b, swap[1] * a, 0.6);
        else
            go(swap[1] * a, swap[1] * b, 0.6);
    }
    *second = *state();
}

static void test_left_and_right_are_exact_mirror_images(void)
{
    for (int profile = BP_COUPLED; profile <= BP_PAPER; profile++) {
        bp_state a, b;
        drive_both_ways(profile, (const double[]){1, 1}, &a, &b);
        TEST_ASSERT_TRUE(a.x == b.x && a.y == -b.y && a.heading == -b.heading);
        TEST_ASSERT_TRUE(a.surge == b.surge && a.sway == -b.sway && a.yaw_rate == -b.yaw_rate);
        TEST_ASSERT_TRUE(a.wheel_speed[0] == b.wheel_speed[1] && a.current[0] == b.current[1]);
        TEST_ASSERT_TRUE(a.wheel_speed[0] != a.wheel_speed[1]);
    }
}

static void test_forward_and_backward_are_exact_mirror_images_of_the_wheels(void)
{
    for (int profile = BP_COUPLED; profile <= BP_PAPER; profile++) {
        bp_state a, b;
        drive_both_ways(profile, (const double[]){0, -1}, &a, &b);
        TEST_ASSERT_TRUE(a.wheel_speed[0] == -b.wheel_speed[0] && a.wheel_speed[1] == -b.wheel_speed[1]);
        TEST_ASSERT_TRUE(a.current[0] == -b.current[0] && a.wheel_angle[1] == -b.wheel_angle[1]);
        if (profile == BP_COUPLED)
            TEST_ASSERT_TRUE(a.surge == -b.surge && a.yaw_rate == -b.yaw_rate);
    }
}

static void test_floating_motor_coasts_longer_than_a_shorted_one_brakes(void)
{
    const bp_state moving = {.surge = 0.5};
    start(&moving);
    go(NAN, NAN, 0.003);
    TEST_ASSERT_EQUAL_DOUBLE(0, state()->current[0]);
    go(NAN, NAN, 0.3);
    const double coasting = state()->surge;
    start(&moving);
    go(0, 0, 0.303);
    const double radius = 0.0408, inertia = 1e-4 + 0.45 * radius * radius;
    const double loss = 1.8e-5 + 0.9 * 9.81 * 0.015 * radius * radius;
    const double brake = loss + 0.195 * 0.245 / 22;
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 0.5 * exp(-loss / inertia * 0.303), coasting);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 0.5 * exp(-brake / inertia * 0.303), state()->surge);
}

static void test_a_floating_motor_loses_its_current_within_one_motor_step(void)
{
    start(NULL);
    go(9, 9, 0.03);
    TEST_ASSERT_TRUE(state()->current[0] > 0.1);
    const double input[2] = {NAN, 9};
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, 0.0003));
    TEST_ASSERT_EQUAL_DOUBLE(0, state()->current[0]);
    TEST_ASSERT_TRUE(state()->current[1] > 0.1);
}

static void test_coupled_wheels_neither_slip_nor_slide(void)
{
    start(NULL);
    go(9, 2, 1);
    const double *w = state()->wheel_speed;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0408 * (w[0] + w[1]) / 2, state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0408 * (w[0] - w[1]) / 0.14, state()->yaw_rate);
    TEST_ASSERT_EQUAL_DOUBLE(0, state()->sway);
    TEST_ASSERT_TRUE(state()->yaw_rate > 1); /* a faster left wheel turns the vehicle to the right, clockwise */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0408 * (state()->wheel_angle[0] - state()->wheel_angle[1]) / 0.14,
                              state()->heading);
}

static void test_wheel_speeds_decide_where_they_disagree_with_the_body(void)
{
    const bp_state both = {.surge = 9, .sway = 1, .wheel_speed = {10, 5}};
    start(&both);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0408 * 7.5, state()->surge);
    TEST_ASSERT_EQUAL_DOUBLE(0, state()->sway);
}

static void test_an_interval_is_divided_evenly(void)
{
    const double input[2] = {6, 6};
    double out[OUTPUT_COUNT];
    start(NULL);
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, 0.0100));
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.0025 / 9, plant.wheels.step);
    plant_outputs(&plant, out);
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, 0.003 * (1 + 1e-9)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0003, plant.wheels.step);
}

static void test_start_refuses_what_is_not_finite(void)
{
    const bp_state bad = {.yaw_rate = NAN};
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, plant_start(&plant, model, &bad, 0, 0));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, plant_start(&plant, model, NULL, -1, 0));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, plant_start(&plant, model, NULL, 0, NAN));
}

static void test_advance_refuses_a_time_that_does_not_pass(void)
{
    const double input[2] = {0, 0};
    start(NULL);
    TEST_ASSERT_EQUAL_INT(BP_E_TIME, plant_advance(&plant, input, 0));
    TEST_ASSERT_EQUAL_INT(BP_E_TIME, plant_advance(&plant, input, NAN));
    TEST_ASSERT_EQUAL_INT(BP_E_TIME, plant_advance(&plant, input, INFINITY));
    TEST_ASSERT_EQUAL_INT(BP_E_TIME, plant_advance(&plant, input, 1e30));
}

static bp_state nothing_given(void)
{
    return (bp_state){NAN, NAN, NAN, NAN, NAN, NAN, {NAN, NAN}, {NAN, NAN}, {NAN, NAN}, NAN, NAN, {NAN, NAN}, NAN};
}

static void test_a_restart_that_gives_nothing_changes_nothing(void)
{
    start(NULL);
    go(5, 3, 0.5);
    const bp_state before = *state(), nothing = nothing_given();
    TEST_ASSERT_EQUAL_INT(0, plant_restart(&plant, &nothing));
    TEST_ASSERT_EQUAL_MEMORY(&before, state(), sizeof before);
}

static void test_a_restart_changes_what_it_gives_and_keeps_the_rest(void)
{
    start(NULL);
    go(5, 3, 0.5);
    const bp_state before = *state();
    bp_state given = nothing_given();
    given.wheel_speed[0] = 4;
    given.wheel_speed[1] = 4;
    given.heading = 1;
    TEST_ASSERT_EQUAL_INT(0, plant_restart(&plant, &given));
    TEST_ASSERT_EQUAL_DOUBLE(4, state()->wheel_speed[0]);
    TEST_ASSERT_EQUAL_DOUBLE(4 * get("wheel_radius"), state()->surge);
    TEST_ASSERT_EQUAL_DOUBLE(0, state()->yaw_rate);
    TEST_ASSERT_EQUAL_DOUBLE(1, state()->heading);
    TEST_ASSERT_EQUAL_DOUBLE(before.current[0], state()->current[0]);
    TEST_ASSERT_EQUAL_DOUBLE(before.wheel_angle[1], state()->wheel_angle[1]);
    TEST_ASSERT_EQUAL_DOUBLE(before.age, state()->age);
}

static void test_a_restart_with_a_yaw_rate_alone_keeps_the_surge(void)
{
    start(NULL);
    go(5, 3, 0.5);
    const double surge = state()->surge;
    bp_state given = nothing_given();
    given.yaw_rate = 2;
    TEST_ASSERT_EQUAL_INT(0, plant_restart(&plant, &given));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, surge, state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2, state()->yaw_rate);
    const double difference = state()->wheel_speed[0] - state()->wheel_speed[1];
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 4 * get("half_track") / get("wheel_radius"), difference);
}

static void test_a_restart_refuses_what_is_infinite(void)
{
    bp_state given = nothing_given();
    given.surge = INFINITY;
    start(NULL);
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, plant_restart(&plant, &given));
}

/* Two windows in one call give what two calls give, but for the sample between them, which ends the first window. The
 * accelerations of the last step, from which the plant extrapolates, are not part of a state: hence the tolerance. */
static void test_a_run_with_a_restart_is_two_windows(void)
{
    enum { SAMPLES = 21, MARK = 10 };
    double time[SAMPLES], input[SAMPLES][2], whole[SAMPLES][OUTPUT_COUNT], second[SAMPLES - MARK][OUTPUT_COUNT];
    for (int k = 0; k < SAMPLES; k++) {
        time[k] = 0.003 * k;
        input[k][0] = 4;
        input[k][1] = 0.2 * k;
    }
    bp_state given = nothing_given();
    given.wheel_speed[0] = 3;
    given.wheel_speed[1] = 2;
    const bp_restart restart = {MARK, given};
    bp_run run = {.model = model, .samples = SAMPLES, .time = time, .input = &input[0][0], .output = &whole[0][0]};
    run.restart_count = 1;
    run.restart = &restart;
    TEST_ASSERT_EQUAL_INT(0, bp_simulate(&run, 1, 1));

    start(NULL);
    for (int k = 0; k < MARK; k++)
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input[k], 0.003));
    bp_run rest = {.model = model, .samples = SAMPLES - MARK, .time = time, .output = &second[0][0]};
    rest.input = &input[MARK][0];
    rest.initial = *state();
    rest.initial.wheel_speed[0] = 3;
    rest.initial.wheel_speed[1] = 2;
    TEST_ASSERT_EQUAL_INT(0, bp_simulate(&rest, 1, 1));
    for (int k = 1; k < SAMPLES - MARK; k++)
        for (int i = 0; i < OUTPUT_COUNT; i++)
            if (!isnan(second[k][i]))
                TEST_ASSERT_DOUBLE_WITHIN(1e-5, second[k][i], whole[MARK + k][i]);
    TEST_ASSERT_TRUE(whole[MARK][OUTPUT_WHEEL_SPEED_LEFT] < 3);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_no_load_speed_is_345_to_351_rpm_at_9_v);
    RUN_TEST(test_steady_speed_balances_motor_and_losses);
    RUN_TEST(test_steady_speed_with_air_drag_balances_the_square);
    RUN_TEST(test_straight_time_constant_has_half_the_mass_on_each_wheel);
    RUN_TEST(test_spin_time_constant_has_the_yaw_inertia);
    RUN_TEST(test_energy_balance_holds);
    RUN_TEST(test_left_and_right_are_exact_mirror_images);
    RUN_TEST(test_forward_and_backward_are_exact_mirror_images_of_the_wheels);
    RUN_TEST(test_floating_motor_coasts_longer_than_a_shorted_one_brakes);
    RUN_TEST(test_a_floating_motor_loses_its_current_within_one_motor_step);
    RUN_TEST(test_coupled_wheels_neither_slip_nor_slide);
    RUN_TEST(test_wheel_speeds_decide_where_they_disagree_with_the_body);
    RUN_TEST(test_an_interval_is_divided_evenly);
    RUN_TEST(test_start_refuses_what_is_not_finite);
    RUN_TEST(test_advance_refuses_a_time_that_does_not_pass);
    RUN_TEST(test_a_restart_that_gives_nothing_changes_nothing);
    RUN_TEST(test_a_restart_changes_what_it_gives_and_keeps_the_rest);
    RUN_TEST(test_a_restart_with_a_yaw_rate_alone_keeps_the_surge);
    RUN_TEST(test_a_restart_refuses_what_is_infinite);
    RUN_TEST(test_a_run_with_a_restart_is_two_windows);
    return UNITY_END();
}
