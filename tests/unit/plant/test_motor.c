#include <math.h>

#include "plant/motor.h"
#include "unity.h"

static const motor_t MOTOR = {.resistance = 20, .inductance = 0.01, .torque_constant = 0.2, .emf_constant = 0.25};
static const double H = 3e-4;

static motor_step_t step;

void setUp(void)
{
    motor_prepare(&step, &step, &MOTOR, H, false, 0);
}
void tearDown(void) {}

static void test_motor_current_rises_exactly_as_one_minus_exp(void)
{
    double current = 0;
    for (int i = 0; i < 5; i++)
        current = motor_end_current(&step, 6, 0, 0, current);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 6.0 / 20 * (1 - exp(-5 * H * 20 / 0.01)), current);
}

/* The current of a speed that rises linearly: the integral of the closed form by Simpson's rule over 2000 parts. */
static void test_motor_mean_current_is_exact_for_a_linear_speed(void)
{
    const double speed = 3, change = 2, start = 0.05, voltage = 6, a = 20 / 0.01;
    const int parts = 2000;
    double sum = 0;
    for (int i = 0; i <= parts; i++) {
        const double t = H * i / parts, rate = change / H;
        const double settled = (voltage - 0.25 * speed + 0.25 * rate / a) / 20;
        const double current = settled - 0.25 * rate * t / 20 + (start - settled) * exp(-a * t);
        sum += (i == 0 || i == parts ? 1 : i % 2 == 1 ? 4 : 2) * current;
        if (i == parts)
            TEST_ASSERT_DOUBLE_WITHIN(1e-13, current, motor_end_current(&step, voltage, speed, change, start));
    }
    const double mean = motor_mean_current(&step, voltage, speed, start) - motor_damping(&step) / 0.2 * change;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, sum / (3 * parts), mean);
}

static void test_motor_without_inductance_follows_the_voltage_at_once(void)
{
    motor_t motor = MOTOR;
    motor.inductance = 0;
    motor_prepare(&step, &step, &motor, H, false, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, (6 - 0.25 * 4) / 20, motor_end_current(&step, 6, 3, 1, 0.7));
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, (6 - 0.25 * 3) / 20, motor_mean_current(&step, 6, 3, 0.7));
}

/* The series for small h R / L and the closed form beyond 1/2 give the same coefficients where they meet. */
static void test_motor_coefficients_are_continuous_in_the_step(void)
{
    const double meeting = 0.5 * 0.01 / 20;
    motor_step_t below = {0}, above = {0};
    motor_prepare(&below, &below, &MOTOR, meeting * (1 - 1e-12), false, 0);
    motor_prepare(&above, &above, &MOTOR, meeting * (1 + 1e-12), false, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, above.decay, below.decay);
    TEST_ASSERT_DOUBLE_WITHIN(1e-11, above.mean_decay, below.mean_decay);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, above.mean_gain, below.mean_gain);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, above.mean_ramp, below.mean_ramp);
}

static void test_motor_of_hardly_any_resistance_is_an_integrator(void)
{
    const motor_t coil = {.resistance = 1e-4, .inductance = 10, .torque_constant = 1, .emf_constant = 1};
    motor_prepare(&step, &step, &coil, H, false, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, H / 10, motor_end_current(&step, 1, 0, 0, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, H / 10 / 2, motor_mean_current(&step, 1, 0, 0));
}

static void test_motor_that_floats_carries_no_current_and_gives_no_torque(void)
{
    motor_prepare(&step, &step, &MOTOR, H, true, 0);
    TEST_ASSERT_EQUAL_DOUBLE(0, motor_end_current(&step, 0, 20, -1, 0.3));
    TEST_ASSERT_EQUAL_DOUBLE(0, motor_mean_current(&step, 0, 20, 0.3));
    TEST_ASSERT_EQUAL_DOUBLE(0, motor_damping(&step));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_motor_current_rises_exactly_as_one_minus_exp);
    RUN_TEST(test_motor_mean_current_is_exact_for_a_linear_speed);
    RUN_TEST(test_motor_without_inductance_follows_the_voltage_at_once);
    RUN_TEST(test_motor_coefficients_are_continuous_in_the_step);
    RUN_TEST(test_motor_of_hardly_any_resistance_is_an_integrator);
    RUN_TEST(test_motor_that_floats_carries_no_current_and_gives_no_torque);
    return UNITY_END();
}
