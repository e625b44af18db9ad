#include "estimator/speed.h"

#include "core/fix.h"

enum {
    Q17_PER_UM_S_Q8_Q15 = 16777,     /* 131.072 / 256: (um/s q8) to (mm/s q17) */
    PER_1000_Q24 = 16777,            /* applied as q15, then 9 bits */
    MM_S2_Q8_PER_Q17_MS_Q14 = 32000, /* 256 * 1000 / 131072: (mm/s q17 per ms) to (mm/s^2 q8) */
    LONGEST_PERIOD_MS = 20,
    MOST_COUNTS = 4096
};

#define SPEED_LIMIT_MM_S_Q17 1073479680L
#define JUMP_LIMIT_MM_S_Q17 536870912L
#define BIAS_LIMIT_MM_S2_Q12 4096000L
#define MOST_TRAVEL_UM_Q5 1073741824L

static const int16_t PER_PERIOD_Q15[LONGEST_PERIOD_MS + 1] = {0,    32767, 16384, 10923, 8192, 6554, 5461,
                                                              4681, 4096,  3641,  3277,  2979, 2731, 2521,
                                                              2341, 2185,  2048,  1928,  1820, 1725, 1638};

/* value / 2^bits, rounded to the nearest. Often 0: sway, bias. */
static int16_t rounded(int32_t value, uint8_t bits)
{
    return value == 0 ? 0 : fix_sat16(fix_round_shift(value, bits));
}

static int16_t to_q4(int32_t speed_mm_s_q17)
{
    return rounded(speed_mm_s_q17, 13);
}

static void learn_bias(const speed_config_t *config, speed_state_t *state, int16_t accel_mm_s2)
{
    uint8_t bits = 0;
    for (uint16_t steps = state->learnt_steps; steps > 0 && bits < config->slowest_weight_bits; steps >>= 1)
        bits++;
    const int32_t error_q12 = (int32_t)accel_mm_s2 * 4096 - state->accel_bias_mm_s2_q12;
    state->accel_bias_mm_s2_q12 =
        fix_clamp32(state->accel_bias_mm_s2_q12 + fix_fraction(error_q12, bits), BIAS_LIMIT_MM_S2_Q12);
    if (state->learnt_steps < 65535U)
        state->learnt_steps++;
}

/* Change of surge by the accelerometer, mm/s q17: eq. 2, with the specific force for X - D_u. */
static int32_t felt_change(const speed_state_t *state, const speed_input_t *input)
{
    const signals_sensors_t *const sensors = input->sensors;
    const int32_t turning_q4 =
        fix_share_q15(fix_mul(to_q4(input->predicted_sway_mm_s_q17), input->yaw_rate_mrad_s), PER_1000_Q24);
    const int16_t accel_mm_s2 = fix_sat16(sensors->accel_surge_mm_s2 -
                                          (int32_t)rounded(state->accel_bias_mm_s2_q12, 12) + rounded(turning_q4, 13));
    return fix_share_q15(fix_mul(accel_mm_s2, sensors->period_ms) * 256, Q17_PER_UM_S_Q8_Q15);
}

static int32_t travel_of_counts_um_q5(const speed_config_t *config, int16_t counts)
{
    const int32_t travel = (int32_t)fix_mul_u16(fix_abs_u16(counts), config->count_travel_um_q2) * 4;
    return counts < 0 ? -travel : travel;
}

/* Travel of the vehicle's middle by the rotation sensors since the step before. */
static int32_t counted_travel_um_q5(const speed_config_t *config, speed_state_t *state,
                                    const signals_sensors_t *sensors)
{
    const int16_t left = (int16_t)(uint16_t)(sensors->rotation_left - state->rotation_left);
    const int16_t right = (int16_t)(uint16_t)(sensors->rotation_right - state->rotation_right);
    const bool known = state->rotation_known;
    state->rotation_left = sensors->rotation_left;
    state->rotation_right = sensors->rotation_right;
    state->rotation_known = true;
    if (!known)
        return 0;
    const int32_t mean = travel_of_counts_um_q5(config, fix_clamp16(fix_add16(left, right), MOST_COUNTS));
    const int32_t turned = travel_of_counts_um_q5(config, fix_clamp16(fix_sub16(left, right), MOST_COUNTS));
    return fix_clamp32(mean + fix_share_q15(turned, config->count_mismatch_q15), MOST_TRAVEL_UM_Q5);
}

/* The sensors' say on the speed predicted; returns the travel by which the rotation sensors move the estimate. */
static int32_t observe(const speed_config_t *config, speed_state_t *state, const speed_input_t *input,
                       int32_t travel_um_q5, int32_t *speed_mm_s_q17)
{
    const signals_sensors_t *const sensors = input->sensors;
    int32_t made_up_um_q5 = 0;
    if (SIGNALS_HAVE(sensors, SENSOR_ACCELEROMETER)) {
        const int32_t predicted_change = fix_sub32(input->predicted_mm_s_q17, state->speed_mm_s_q17);
        const int32_t surprise = fix_sub32(felt_change(state, input), predicted_change);
        *speed_mm_s_q17 = fix_add32(*speed_mm_s_q17, fix_share_q15(surprise, config->accel_gain_q15));
    }
    if (SIGNALS_HAVE(sensors, SENSOR_ROTATION)) {
        const int32_t behind = state->behind_um_q5 + counted_travel_um_q5(config, state, sensors) - travel_um_q5;
        made_up_um_q5 = fix_share_q15(behind, config->behind_to_travel_q15);
        state->behind_um_q5 = fix_clamp32(behind - made_up_um_q5, SPEED_BEHIND_LIMIT_UM_Q5);
        *speed_mm_s_q17 = fix_add32(*speed_mm_s_q17, fix_share_q15(state->behind_um_q5, config->behind_to_speed_q15));
    }
    return made_up_um_q5;
}

static void filter_accel(const speed_config_t *config, speed_state_t *state, int32_t speed_mm_s_q17, uint8_t period_ms)
{
    const uint8_t period = period_ms > LONGEST_PERIOD_MS ? LONGEST_PERIOD_MS : period_ms;
    const int32_t jump = fix_clamp32(fix_sub32(speed_mm_s_q17, state->speed_mm_s_q17), JUMP_LIMIT_MM_S_Q17);
    const int32_t accel_mm_s2_q8 =
        2 * fix_share_q15(fix_share_q15(jump, PER_PERIOD_Q15[period]), MM_S2_Q8_PER_Q17_MS_Q14);
    state->accel_mm_s2_q8 += fix_share_q15(fix_sub32(accel_mm_s2_q8, state->accel_mm_s2_q8), config->accel_filter_q15);
}

/* Travel at the mean of two speeds. */
static int32_t travel(int16_t before_mm_s_q4, int16_t after_mm_s_q4, uint8_t period_ms)
{
    if (before_mm_s_q4 == 0 && after_mm_s_q4 == 0)
        return 0;
    return fix_mul(before_mm_s_q4, period_ms) + fix_mul(after_mm_s_q4, period_ms);
}

void speed_step(const speed_config_t *config, speed_state_t *state, const speed_input_t *input, speed_output_t *output)
{
    const signals_sensors_t *const sensors = input->sensors;
    int32_t speed = input->predicted_mm_s_q17;
    const int16_t sway_mm_s_q4 = to_q4(input->predicted_sway_mm_s_q17);
    const int32_t predicted_travel = travel(state->speed_mm_s_q4, to_q4(speed), sensors->period_ms);

    if (input->at_rest && SIGNALS_HAVE(sensors, SENSOR_ACCELEROMETER))
        learn_bias(config, state, sensors->accel_surge_mm_s2);
    output->travel_um_q5 = predicted_travel + observe(config, state, input, predicted_travel, &speed);
    if (input->at_rest) {
        speed = 0;
        state->behind_um_q5 = 0;
        output->travel_um_q5 = 0;
    }
    if (SIGNALS_HAVE(sensors, SENSOR_REFERENCE)) {
        speed = sensors->reference_speed_mm_s_q4 * 8192L;
        output->travel_um_q5 = travel(state->speed_mm_s_q4, to_q4(speed), sensors->period_ms);
    }
    speed = fix_clamp32(speed, SPEED_LIMIT_MM_S_Q17);
    filter_accel(config, state, speed, sensors->period_ms);
    output->sway_travel_um_q5 = travel(state->sway_mm_s_q4, sway_mm_s_q4, sensors->period_ms);
    state->speed_mm_s_q17 = speed;
    state->speed_mm_s_q4 = to_q4(speed);
    state->sway_mm_s_q4 = sway_mm_s_q4;

    output->correction_mm_s_q17 = fix_sub32(speed, input->predicted_mm_s_q17);
    output->speed_mm_s_q4 = state->speed_mm_s_q4;
    output->accel_mm_s2 = rounded(state->accel_mm_s2_q8, 8);
}
