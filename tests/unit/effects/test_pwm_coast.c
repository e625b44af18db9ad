#include "affected.h"

static const double FLOATS[] = {0.001, 0};
static const double BRAKES[] = {0.001, 1};

/* Returns the mean current of the stalled left motor over whole ticks, with motor steps of `step` s. */
static double stalled_current(double voltage, double step)
{
    set("wheel_inertia", 1e4);
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, affected, NULL, step, step));
    const double input[2] = {voltage, 0};
    double sum = 0;
    const int steps = (int)(1.8 / step + 0.5);
    for (int i = 0; i < steps; i++) {
        const double before = plant.vehicle.state.current[0];
        plant_advance(&plant, input, step);
        const double volts = isnan(plant.vehicle.voltage[0]) ? 0 : plant.vehicle.voltage[0];
        /* R times the mean current is V less what L takes; a motor that floats has none */
        const double taken = 0.01 * (plant.vehicle.state.current[0] - before) / step;
        sum += isnan(plant.vehicle.voltage[0]) ? 0 : (volts - taken) / 22;
    }
    return sum / steps;
}

static void test_where_it_brakes_a_stalled_motor_has_duty_times_the_voltage(void)
{
    use("pwm_coast", BRAKES);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 4.5 / 22, stalled_current(4.5, 0.0003));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 3.0 / 22, stalled_current(3, 0.0003));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, -6.3 / 22, stalled_current(-6.3, 0.0003));
}

/* Lone pulses of one tick, each from no current: duty V / R (1 - (1 - e^-a) / a), a = tick R / L. */
static void test_where_it_floats_every_pulse_begins_without_current(void)
{
    const double a = 0.001 * 22 / 0.01, share = 1 - (1 - exp(-a)) / a;
    use("pwm_coast", FLOATS);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, share * 4.5 / 22, stalled_current(4.5, 0.00005));
    TEST_ASSERT_DOUBLE_WITHIN(0.015 * share * 4.5 / 22, share * 4.5 / 22, stalled_current(4.5, 0.0003));
    TEST_ASSERT_DOUBLE_WITHIN(0.015 * share * 3 / 22, share * 3.0 / 22, stalled_current(3, 0.0003));
}

/* Without inductance: duty K_t (9 - K_e w) / R = loss w; pulses that brake would give K_t (duty 9 - K_e w) / R. */
static void test_half_power_is_not_half_voltage(void)
{
    use("pwm_coast", FLOATS);
    set("inductance", 0);
    set("drag_area", 0);
    const double loss = 1.8e-5 + 0.9 * 9.81 * 0.015 * 0.0408 * 0.0408, k = 0.5 * 0.195 / 22;
    start(affected, NULL);
    go(4.5, 4.5, 20);
    const double steady = k * 9 / (loss + k * 0.245);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, steady, plant.vehicle.state.wheel_speed[0]);
    start(plain, NULL);
    go(4.5, 4.5, 20);
    TEST_ASSERT_TRUE(plant.vehicle.state.wheel_speed[0] < 0.6 * steady);
}

/* Ticks of a third of a body step, motor steps of a third of a tick and any duty: the pulses add up. */
static void test_pulses_add_up_to_the_duty(void)
{
    use("pwm_coast", BRAKES);
    for (int percent = 1; percent <= 99; percent += 7) {
        start(affected, NULL);
        double on = 0;
        for (int i = 0; i < 10000; i++) {
            const double input[2] = {0.09 * percent, -9};
            plant_advance(&plant, input, 0.0003);
            on += plant.vehicle.voltage[0] / 9;
            TEST_ASSERT_TRUE(plant.vehicle.voltage[0] == 0 || plant.vehicle.voltage[0] == 9);
            TEST_ASSERT_TRUE(plant.vehicle.voltage[1] == -9);
        }
        TEST_ASSERT_DOUBLE_WITHIN(4, 100 * percent, on);
    }
}

static void test_full_duty_shorted_and_floating_change_nothing(void)
{
    use("pwm_coast", FLOATS);
    assert_same(tour(plain, 9, -9), tour(affected, 9, -9));
    assert_same(tour(plain, 0, NAN), tour(affected, 0, NAN));
}

static void test_a_tick_shorter_than_the_step_still_gives_the_duty(void)
{
    const double brief[] = {1e-4, 1};
    use("pwm_coast", brief);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 3.0 / 22, stalled_current(3, 0.0003));
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("pwm_coast", FLOATS);
    assert_reversal();
    assert_mirror("pwm_coast", FLOATS);
    make_motor("pwm_coast", FLOATS);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_where_it_brakes_a_stalled_motor_has_duty_times_the_voltage);
    RUN_TEST(test_where_it_floats_every_pulse_begins_without_current);
    RUN_TEST(test_half_power_is_not_half_voltage);
    RUN_TEST(test_pulses_add_up_to_the_duty);
    RUN_TEST(test_full_duty_shorted_and_floating_change_nothing);
    RUN_TEST(test_a_tick_shorter_than_the_step_still_gives_the_duty);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
