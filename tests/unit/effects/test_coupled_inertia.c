#include "drive.h"

static const double FORCE = 50, LOAD = 100; /* N at 1 V, kg */
static const double FULL_TURN = 6.283185307179586;

void setUp(void)
{
    axis();
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

static void couple(double period, double share, double damping, double sensed)
{
    const double values[] = {period, share, damping, sensed};
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "coupled_inertia", values));
}

/* A constant force F on the first of two masses M and s M. What the second is ahead, p, is a damped oscillation about
 * -F / (M w^2); the speed of the second follows from the total momentum F t. */
typedef struct {
    double first, second, ahead; /* m/s, m/s, m */
} two_masses_t;

static two_masses_t pushed(double period, double share, double damping, double t)
{
    const double rate = FULL_TURN / period, decay = damping * rate, swing = rate * sqrt(1 - damping * damping);
    const double rest = -FORCE / (LOAD * rate * rate), fade = exp(-decay * t);
    const double ahead = rest * (1 - fade * (cos(swing * t) + decay / swing * sin(swing * t)));
    const double slip = rest * fade * rate * rate / swing * sin(swing * t);
    const double second = (FORCE * t / LOAD + slip) / (1 + share);
    return (two_masses_t){second - slip, second, ahead};
}

static void assert_pushed(double period, double share, double damping)
{
    couple(period, share, damping, 0);
    start(NULL);
    for (int i = 1; i <= 20; i++) {
        go(1, 0, 0.03);
        const two_masses_t expected = pushed(period, share, damping, 0.03 * i);
        TEST_ASSERT_DOUBLE_WITHIN(4e-4, expected.first, out[OUTPUT_VELOCITY]);
    }
}

static void test_two_masses_swing_against_each_other(void)
{
    assert_pushed(0.25, 0.5, 0);
}

static void test_the_swing_is_damped(void)
{
    assert_pushed(0.2, 3, 0.3);
}

static void test_a_light_second_mass_swings_alone(void)
{
    assert_pushed(0.3, 0.01, 0.05);
}

static void test_a_second_mass_of_nothing_swings_unfelt(void)
{
    assert_pushed(0.3, 0, 0.05);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, FORCE * 0.6 / LOAD, out[OUTPUT_VELOCITY]);
}

static void test_a_sensor_on_the_second_mass_reads_that(void)
{
    couple(0.25, 0.5, 0.1, 1);
    start(NULL);
    double position = 0;
    for (int i = 1; i <= 20; i++) {
        const two_masses_t before = pushed(0.25, 0.5, 0.1, 0.03 * i - 0.015);
        go(1, 0, 0.03);
        const two_masses_t expected = pushed(0.25, 0.5, 0.1, 0.03 * i);
        TEST_ASSERT_DOUBLE_WITHIN(4e-4, expected.second, out[OUTPUT_VELOCITY]);
        position += 0.03 * before.second;
        TEST_ASSERT_DOUBLE_WITHIN(5e-4, position, out[OUTPUT_POSITION]);
    }
}

/* A stiff spring makes one mass of both, whatever the motor step. */
static void test_a_stiff_spring_joins_both(void)
{
    couple(0, 1, 1, 1);
    start(NULL);
    go(1, 0, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, FORCE * 0.6 / (2 * LOAD), out[OUTPUT_VELOCITY]);
}

static void test_a_run_that_starts_in_motion_starts_without_a_swing(void)
{
    const bp_state moving = {.wheel_speed = {0.4}};
    couple(0.25, 0.5, 0.1, 1);
    start(&moving);
    go(0, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4, out[OUTPUT_VELOCITY]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.4 * 0.3, out[OUTPUT_POSITION]);
}

/* Straight ahead, both wheels of a robot move the share's part more of what they move. */
static void test_a_robot_has_one_at_each_wheel(void)
{
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
    set("emf_constant", 0);
    set("inductance", 0);
    couple(0.1, 0.5, 0.5, 0);
    start(NULL);
    go(6, 6, 0.6);
    const double each = WHEEL_INERTIA + 0.5 * MASS * RADIUS * RADIUS;
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * state()->wheel_speed[0], 6 * GAIN * 0.6 / (1.5 * each), state()->wheel_speed[0]);
    TEST_ASSERT_EQUAL_DOUBLE(state()->wheel_speed[0], state()->wheel_speed[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_two_masses_swing_against_each_other);
    RUN_TEST(test_the_swing_is_damped);
    RUN_TEST(test_a_light_second_mass_swings_alone);
    RUN_TEST(test_a_second_mass_of_nothing_swings_unfelt);
    RUN_TEST(test_a_sensor_on_the_second_mass_reads_that);
    RUN_TEST(test_a_stiff_spring_joins_both);
    RUN_TEST(test_a_run_that_starts_in_motion_starts_without_a_swing);
    RUN_TEST(test_a_robot_has_one_at_each_wheel);
    return UNITY_END();
}
