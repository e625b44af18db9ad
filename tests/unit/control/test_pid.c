#include "control/pid.h"
#include "unity.h"

#include <math.h>
#include <stdbool.h>

static const pid_config_t CONFIG = {.kp_mv_q10 = 3000, .ki_mv_q10 = 5000, .kd_mv_q10 = 700, .limit_mv = 9000};
static pid_state_t state;

void setUp(void)
{
    state = (pid_state_t){0};
}
void tearDown(void) {}

static pid_output_t step(const pid_config_t *config, pid_input_t input)
{
    pid_output_t output;
    pid_step(config, &state, &input, &output);
    return output;
}

/* A 16-bit number that depends on its place in the sequence alone; never INT16_MIN. */
static int16_t scatter(uint32_t index)
{
    uint32_t mixed = index * 2654435761U;
    mixed ^= mixed >> 15;
    mixed *= 2246822519U;
    return (int16_t)((int32_t)(mixed >> 16) - 32768 + ((mixed >> 16) == 0));
}

static pid_input_t scattered_input(uint32_t index)
{
    return (pid_input_t){
        .error = (int16_t)(scatter(4 * index) / 16),
        .rate = (int16_t)(scatter(4 * index + 1) / 16),
        .feedforward_mv = (int16_t)(scatter(4 * index + 2) / 16),
        .saturated = (int8_t)(scatter(4 * index + 3) % 2),
        .period_ms = (uint8_t)(1 + index % 20),
    };
}

static void test_pid_proportional_part_is_gain_times_error(void)
{
    const pid_config_t config = {.kp_mv_q10 = 3000, .limit_mv = 32000};
    for (int error = -6000; error <= 6000; error++) {
        const pid_output_t output = step(&config, (pid_input_t){.error = (int16_t)error, .period_ms = 3});
        TEST_ASSERT_EQUAL_INT16(lround(error * 3000.0 / 1024.0), output.output_mv);
        TEST_ASSERT_EQUAL_INT16(output.output_mv, output.proportional_mv);
    }
}

static void test_pid_derivative_part_opposes_the_rate_of_the_measurement(void)
{
    const pid_config_t config = {.kd_mv_q10 = 1536, .limit_mv = 32000};
    TEST_ASSERT_EQUAL_INT16(-1500, step(&config, (pid_input_t){.rate = 1000, .period_ms = 3}).output_mv);
    TEST_ASSERT_EQUAL_INT16(1500, step(&config, (pid_input_t){.rate = -1000, .period_ms = 3}).derivative_mv);
}

static void test_pid_feedforward_is_added(void)
{
    const pid_output_t without = step(&CONFIG, (pid_input_t){.error = 500, .period_ms = 3});
    state = (pid_state_t){0};
    const pid_output_t with = step(&CONFIG, (pid_input_t){.error = 500, .feedforward_mv = -1234, .period_ms = 3});
    TEST_ASSERT_EQUAL_INT16(without.output_mv - 1234, with.output_mv);
}

static void test_pid_new_demand_causes_no_derivative_kick(void)
{
    const pid_output_t before = step(&CONFIG, (pid_input_t){.error = 0, .rate = 100, .period_ms = 3});
    const pid_output_t after = step(&CONFIG, (pid_input_t){.error = 2000, .rate = 100, .period_ms = 3});
    TEST_ASSERT_EQUAL_INT16(before.derivative_mv, after.derivative_mv);
}

static void test_pid_integral_follows_the_closed_form_at_every_period(void)
{
    const pid_config_t config = {.ki_mv_q10 = 1700, .limit_mv = 32000};
    for (uint8_t period = 1; period <= 20; period++) {
        state = (pid_state_t){0};
        pid_output_t output = {0};
        uint32_t steps = 0;
        for (uint32_t time = 0; time < 60000; time += period, steps++)
            output = step(&config, (pid_input_t){.error = 150, .period_ms = period});
        const double expected = 150.0 * 1700.0 / 1024.0 * (steps - 1) * period / 1000.0;
        TEST_ASSERT_DOUBLE_WITHIN(0.5 + 5e-4 * expected + steps / 16384.0, expected, output.integral_mv);
    }
}

static void test_pid_takes_a_period_beyond_20_ms_for_20_ms(void)
{
    step(&CONFIG, (pid_input_t){.error = 100, .period_ms = 20});
    const int32_t after_20_ms = state.integral_mv_q16;
    state = (pid_state_t){0};
    step(&CONFIG, (pid_input_t){.error = 100, .period_ms = 21});
    TEST_ASSERT_EQUAL_INT32(after_20_ms, state.integral_mv_q16);
}

/* A first-order drive, 0.12 m/s per volt and 150 ms, sampled exactly. */
static double drive_m_s(double speed_m_s, double voltage, double period_s)
{
    const double end = 0.12 * voltage;
    return end + (speed_m_s - end) * exp(-period_s / 0.15);
}

static int16_t error_q4(double demand_m_s, double speed_m_s)
{
    return (int16_t)lround(16000.0 * (demand_m_s - speed_m_s));
}

/* PI with its zero on the drive's pole: the loop is first order with 150 ms / (20 V s/m * 0.12 m/s/V) = 62.5 ms. */
static void test_pid_step_response_follows_the_closed_form(void)
{
    const pid_config_t config = {.kp_mv_q10 = 20 * 64, .ki_mv_q10 = 8533, .limit_mv = 9000};
    double speed = 0.0;
    for (int ms = 0; ms < 500; ms++) {
        TEST_ASSERT_DOUBLE_WITHIN(0.004, 0.3 * (1.0 - exp(-ms / 62.5)), speed);
        const pid_output_t output = step(&config, (pid_input_t){.error = error_q4(0.3, speed), .period_ms = 1});
        speed = drive_m_s(speed, output.output_mv / 1000.0, 0.001);
    }
}

/* How long the speed stays above 0.55 m/s when, after 4 s of a demand that 9 V do not reach, 0.5 m/s is asked for. */
static int recovery_ms(bool told)
{
    const pid_config_t config = {.kp_mv_q10 = 20 * 64, .ki_mv_q10 = 8533, .limit_mv = 32000};
    double speed = 0.0;
    int above_until_ms = 0;
    int8_t saturated = 0;
    state = (pid_state_t){0};
    for (int ms = 0; ms < 6000; ms += 3) {
        const pid_input_t input = {
            .error = error_q4(ms < 4000 ? 1.5 : 0.5, speed), .saturated = told ? saturated : 0, .period_ms = 3};
        const pid_output_t output = step(&config, input);
        const double voltage = fmin(fmax(output.output_mv / 1000.0, -9.0), 9.0);
        saturated = (int8_t)((output.output_mv > 9000) - (output.output_mv < -9000));
        speed = drive_m_s(speed, voltage, 0.003);
        if (speed > 0.55)
            above_until_ms = ms;
    }
    return above_until_ms - 4000;
}

static void test_pid_does_not_wind_up_while_the_mixer_saturates(void)
{
    TEST_ASSERT_LESS_THAN_INT(180, recovery_ms(true));
    TEST_ASSERT_GREATER_THAN_INT(220, recovery_ms(false));
}

static void test_pid_integrator_stops_when_mixer_saturates_and_only_in_that_direction(void)
{
    state.integral_mv_q16 = 1000L * 65536;
    step(&CONFIG, (pid_input_t){.error = 50, .saturated = 1, .period_ms = 3});
    TEST_ASSERT_EQUAL_INT32(1000L * 65536, state.integral_mv_q16);
    step(&CONFIG, (pid_input_t){.error = -50, .saturated = 1, .period_ms = 3});
    TEST_ASSERT_LESS_THAN_INT32(1000L * 65536, state.integral_mv_q16);
    const int32_t shrunk = state.integral_mv_q16;
    step(&CONFIG, (pid_input_t){.error = -50, .saturated = -1, .period_ms = 3});
    TEST_ASSERT_EQUAL_INT32(shrunk, state.integral_mv_q16);
    step(&CONFIG, (pid_input_t){.error = 50, .saturated = -1, .period_ms = 3});
    TEST_ASSERT_GREATER_THAN_INT32(shrunk, state.integral_mv_q16);
}

static void test_pid_integrator_stops_when_its_own_limit_cuts(void)
{
    const pid_output_t output = step(&CONFIG, (pid_input_t){.error = 20000, .period_ms = 3});
    TEST_ASSERT_EQUAL_INT16(9000, output.output_mv);
    TEST_ASSERT_EQUAL_INT8(1, output.limited);
    TEST_ASSERT_EQUAL_INT32(0, state.integral_mv_q16);
    TEST_ASSERT_EQUAL_INT8(-1, step(&CONFIG, (pid_input_t){.error = -20000, .period_ms = 3}).limited);
    TEST_ASSERT_EQUAL_INT32(0, state.integral_mv_q16);
}

static void test_pid_integral_alone_stays_within_the_limit(void)
{
    const pid_config_t config = {.ki_mv_q10 = INT16_MAX, .limit_mv = 32000};
    for (int i = 0; i < 1000; i++)
        step(&config, (pid_input_t){.error = INT16_MIN, .period_ms = 20});
    TEST_ASSERT_EQUAL_INT32(-32000L * 65536, state.integral_mv_q16);
}

static void test_pid_starts_without_a_bump(void)
{
    const pid_config_t config = {.kp_mv_q10 = 900, .ki_mv_q10 = 5000, .kd_mv_q10 = 700, .limit_mv = 32000};
    for (uint32_t i = 0; i < 5000; i++) {
        const pid_input_t input = scattered_input(i);
        const int16_t wanted_mv = (int16_t)(scatter(i + 77777) / 4);
        pid_start(&config, &state, &input, wanted_mv);
        TEST_ASSERT_INT16_WITHIN(1, wanted_mv, step(&config, input).output_mv);
    }
}

static void test_pid_start_keeps_the_integrator_within_the_limit(void)
{
    const pid_input_t input = {.error = -30000, .period_ms = 3};
    pid_start(&CONFIG, &state, &input, 9000);
    TEST_ASSERT_EQUAL_INT32(9000L * 65536, state.integral_mv_q16);
}

static void test_pid_stop_empties_the_integrator(void)
{
    pid_output_t output = {.limited = 1, .output_mv = 1, .proportional_mv = 2, .integral_mv = 3, .derivative_mv = 4};
    state = (pid_state_t){.integral_mv_q16 = 5};
    pid_stop(&state, &output);
    TEST_ASSERT_EQUAL_INT8(0, output.limited);
    TEST_ASSERT_EQUAL_INT16(0, output.output_mv);
    TEST_ASSERT_EQUAL_INT16(0, output.proportional_mv);
    TEST_ASSERT_EQUAL_INT16(0, output.integral_mv);
    TEST_ASSERT_EQUAL_INT16(0, output.derivative_mv);
    TEST_ASSERT_EQUAL_INT32(0, state.integral_mv_q16);
}

static void test_pid_is_the_same_backward(void)
{
    pid_state_t forward = {0};
    pid_state_t backward = {0};
    for (uint32_t i = 0; i < 20000; i++) {
        const pid_input_t input = scattered_input(i);
        const pid_input_t mirrored_input = {.error = (int16_t)-input.error,
                                            .rate = (int16_t)-input.rate,
                                            .feedforward_mv = (int16_t)-input.feedforward_mv,
                                            .saturated = (int8_t)-input.saturated,
                                            .period_ms = input.period_ms};
        pid_output_t output, mirrored;
        pid_step(&CONFIG, &forward, &input, &output);
        pid_step(&CONFIG, &backward, &mirrored_input, &mirrored);
        TEST_ASSERT_EQUAL_INT16(-output.output_mv, mirrored.output_mv);
        TEST_ASSERT_EQUAL_INT8(-output.limited, mirrored.limited);
        TEST_ASSERT_EQUAL_INT32(-forward.integral_mv_q16, backward.integral_mv_q16);
    }
}

static void test_pid_takes_the_ends_of_every_range(void)
{
    const pid_config_t config = {
        .kp_mv_q10 = INT16_MAX, .ki_mv_q10 = INT16_MAX, .kd_mv_q10 = INT16_MAX, .limit_mv = 32000};
    const pid_input_t lowest = {.error = INT16_MIN, .rate = INT16_MAX, .feedforward_mv = INT16_MIN, .period_ms = 20};
    const pid_input_t highest = {.error = INT16_MAX, .rate = INT16_MIN, .feedforward_mv = INT16_MAX, .period_ms = 20};
    const pid_output_t low = step(&config, lowest);
    TEST_ASSERT_EQUAL_INT16(-32000, low.output_mv);
    TEST_ASSERT_EQUAL_INT16(-32767, low.proportional_mv);
    TEST_ASSERT_EQUAL_INT16(-32767, low.derivative_mv);
    TEST_ASSERT_EQUAL_INT16(32000, step(&config, highest).output_mv);
}

static void test_pid_integrates_the_period_and_no_more_than_20_ms(void)
{
    const pid_config_t config = {.ki_mv_q10 = 16384, .limit_mv = 32000};
    int32_t sum_q14 = 0;
    for (int period_ms = 1; period_ms <= 22; period_ms++) {
        const int counted_ms = period_ms < 20 ? period_ms : 20;
        setUp();
        step(&config, (pid_input_t){.error = 4096, .period_ms = (uint8_t)period_ms});
        TEST_ASSERT_INT32_WITHIN(2, 1048576 * counted_ms / 1000, state.integral_mv_q16 / 4096);
        sum_q14 += state.integral_mv_q16 / 4096;
    }
    TEST_ASSERT_EQUAL_INT32(262159, sum_q14); /* the same on every brick */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_pid_proportional_part_is_gain_times_error);
    RUN_TEST(test_pid_derivative_part_opposes_the_rate_of_the_measurement);
    RUN_TEST(test_pid_feedforward_is_added);
    RUN_TEST(test_pid_new_demand_causes_no_derivative_kick);
    RUN_TEST(test_pid_integral_follows_the_closed_form_at_every_period);
    RUN_TEST(test_pid_takes_a_period_beyond_20_ms_for_20_ms);
    RUN_TEST(test_pid_step_response_follows_the_closed_form);
    RUN_TEST(test_pid_does_not_wind_up_while_the_mixer_saturates);
    RUN_TEST(test_pid_integrator_stops_when_mixer_saturates_and_only_in_that_direction);
    RUN_TEST(test_pid_integrator_stops_when_its_own_limit_cuts);
    RUN_TEST(test_pid_integral_alone_stays_within_the_limit);
    RUN_TEST(test_pid_starts_without_a_bump);
    RUN_TEST(test_pid_start_keeps_the_integrator_within_the_limit);
    RUN_TEST(test_pid_stop_empties_the_integrator);
    RUN_TEST(test_pid_is_the_same_backward);
    RUN_TEST(test_pid_takes_the_ends_of_every_range);
    RUN_TEST(test_pid_integrates_the_period_and_no_more_than_20_ms);
    return UNITY_END();
}
