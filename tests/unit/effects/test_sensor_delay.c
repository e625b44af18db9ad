#include <math.h>
#include <stdlib.h>

#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

enum { SAMPLES = 400 };

static double past[SAMPLES][OUTPUT_COUNT];

/* A manoeuvre in which every signal changes. */
static void drive(double dt, int k)
{
    advance(6 * sin(9 * k * dt), 4 * cos(7 * k * dt), dt);
    for (int i = 0; i < OUTPUT_COUNT; i++)
        past[k][i] = truth[i];
}

static void test_every_measured_signal_is_that_of_the_delay_before(void)
{
    const double delay = 7.25 * STEP;
    begin("sensor_delay", &delay, NULL);
    for (int k = 0; k < SAMPLES; k++) {
        drive(STEP, k);
        if (k >= 8)
            for (int i = 0; i <= OUTPUT_BATTERY_VOLTAGE; i++)
                TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.75 * past[k - 7][i] + 0.25 * past[k - 8][i], seen[i]);
    }
    assert_only(0, OUTPUT_BATTERY_VOLTAGE);
}

/* Body steps of 0.5 ms and 2.5 ms in turn: a delayed mean is made of parts of both. */
static void test_an_acceleration_is_a_mean_over_uneven_steps(void)
{
    static double time[SAMPLES], speed[SAMPLES];
    const double delay = 0.0404;
    double shown = 0;
    begin("sensor_delay", &delay, NULL);
    for (int k = 1; k < SAMPLES; k++) {
        const double dt = k % 2 ? 0.0005 : 0.0025;
        advance(k % 40 < 20 ? 6 : 0, k % 40 < 20 ? 6 : 0, dt);
        time[k] = time[k - 1] + dt;
        speed[k] = speed[k - 1] + dt * truth[OUTPUT_ACCEL_SURGE];
        shown += dt * seen[OUTPUT_ACCEL_SURGE];
        int at = k;
        while (at > 0 && time[at] > time[k] - delay)
            at--;
        const double share = (time[k] - delay - time[at]) / (time[at + 1] - time[at]);
        const double before = time[k] < delay ? 0 : speed[at] + share * (speed[at + 1] - speed[at]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, before, shown);
    }
    TEST_ASSERT_TRUE(fabs(speed[SAMPLES - 1]) > 1e-3);
}

static void test_before_anything_arrives_the_first_values_hold(void)
{
    const double delay = 0.05;
    const bp_state moving = {.surge = 0.3, .yaw_rate = 1, .heading = 2};
    begin("sensor_delay", &delay, &moving);
    const double rate = seen[OUTPUT_YAW_RATE];
    assert_only(0, -1);
    go(0, 0, 0.048);
    TEST_ASSERT_TRUE(truth[OUTPUT_YAW_RATE] < 0.99 * rate);
    TEST_ASSERT_TRUE(seen[OUTPUT_YAW_RATE] == rate && seen[OUTPUT_YAW_ANGLE] == 2);
    go(0, 0, 0.006);
    TEST_ASSERT_TRUE(seen[OUTPUT_YAW_RATE] < rate);
}

static void test_a_delay_of_zero_changes_nothing(void)
{
    const double none = 0;
    begin("sensor_delay", &none, NULL);
    go(7, 3, 0.9);
    assert_only(0, -1);
}

/* 300 ms at 0.1 ms are more steps than the ring has rows, and no sample falls on a body step of another. */
static void test_a_long_delay_of_many_short_and_uneven_steps_is_kept(void)
{
    static double time[10000], angle[10000];
    const double delay = 0.3;
    begin("sensor_delay", &delay, NULL);
    srand(1);
    for (int k = 1; k < 10000; k++) {
        const double dt = 1e-4 * (0.5 + rand() / (double)RAND_MAX);
        advance(6, -4, dt);
        time[k] = time[k - 1] + dt;
        angle[k] = truth[OUTPUT_YAW_ANGLE];
        int at = k;
        while (at > 0 && time[at] > time[k] - delay)
            at--;
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, angle[at], seen[OUTPUT_YAW_ANGLE]);
    }
    TEST_ASSERT_TRUE(truth[OUTPUT_YAW_ANGLE] > 2);
}

static void test_a_motors_signals_are_late_too(void)
{
    const double delay = 4 * STEP;
    twin_free();
    twin_new(BP_MOTOR);
    bp_model_set(plain, "wheel_radius", 0.02);
    bp_model_set(changed, "wheel_radius", 0.02);
    begin("sensor_delay", &delay, NULL);
    for (int k = 0; k < 100; k++) {
        drive(STEP, k);
        for (int i = OUTPUT_BATTERY_VOLTAGE; k >= 4 && i <= OUTPUT_FORCE; i++)
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, past[k - 4][i], seen[i]);
    }
    TEST_ASSERT_TRUE(truth[OUTPUT_FORCE] != 0);
    assert_only(OUTPUT_BATTERY_VOLTAGE, OUTPUT_FORCE);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_measured_signal_is_that_of_the_delay_before);
    RUN_TEST(test_an_acceleration_is_a_mean_over_uneven_steps);
    RUN_TEST(test_before_anything_arrives_the_first_values_hold);
    RUN_TEST(test_a_delay_of_zero_changes_nothing);
    RUN_TEST(test_a_long_delay_of_many_short_and_uneven_steps_is_kept);
    RUN_TEST(test_a_motors_signals_are_late_too);
    return UNITY_END();
}
