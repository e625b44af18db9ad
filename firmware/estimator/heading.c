#include "estimator/heading.h"

#include "core/fix.h"

/* bam32 per mrad/s, ms and 2^-9: 2^32 / (2 pi 1e6 2^9) = 1.335089, less 1, Q16. */
enum { BAM32_PER_MRAD_Q9_LESS_1_Q16 = 21960 };

static int32_t bam32_of(int32_t angle_urad_q9)
{
    const uint32_t magnitude = fix_abs_u32(angle_urad_q9);
    const int32_t turned = (int32_t)(magnitude + fix_mul_u32_q16(magnitude, BAM32_PER_MRAD_Q9_LESS_1_Q16));
    return angle_urad_q9 < 0 ? -turned : turned;
}

static bool moves(const heading_config_t *config, heading_state_t *state, const heading_input_t *input)
{
    const signals_sensors_t *const sensors = input->sensors;
    bool counted = false;
    if (SIGNALS_HAVE(sensors, SENSOR_ROTATION)) {
        counted = sensors->rotation_left != state->rotation_left || sensors->rotation_right != state->rotation_right;
        state->rotation_left = sensors->rotation_left;
        state->rotation_right = sensors->rotation_right;
    }
    return counted || input->driven || fix_abs_u16(input->predicted_speed_mm_s_q4) > config->rest_speed_mm_s_q4 ||
           !SIGNALS_HAVE(sensors, SENSOR_GYRO);
}

static void learn_block(const heading_config_t *config, heading_state_t *state)
{
    const int32_t mean_q8 = state->block_sum_mrad_s * (256 / HEADING_BLOCK_STEPS);
    uint8_t bits = 0;
    for (uint8_t blocks = state->learnt_blocks; blocks > 0 && bits < config->slowest_weight_bits; blocks >>= 1)
        bits++;
    const int32_t bias_q8 = state->bias_mrad_s_q8 + fix_fraction(mean_q8 - state->bias_mrad_s_q8, bits);
    state->bias_mrad_s_q8 = (int16_t)fix_clamp32(bias_q8, HEADING_BIAS_LIMIT_MRAD_S * 256L);
    if (state->learnt_blocks < 255)
        state->learnt_blocks++;
}

static void watch_rest(const heading_config_t *config, heading_state_t *state, const heading_input_t *input,
                       int16_t rate)
{
    const bool first = state->block_steps == 0;
    if (first || rate < state->block_least_mrad_s)
        state->block_least_mrad_s = rate;
    if (first || rate > state->block_most_mrad_s)
        state->block_most_mrad_s = rate;
    const bool loud = (int32_t)state->block_most_mrad_s - state->block_least_mrad_s > config->quiet_mrad_s;
    if (moves(config, state, input) || loud) {
        state->block_steps = 0;
        state->at_rest = false;
        return;
    }
    state->block_sum_mrad_s = rate + (first ? 0 : state->block_sum_mrad_s);
    if (++state->block_steps == HEADING_BLOCK_STEPS) {
        learn_block(config, state);
        state->block_steps = 0;
        state->at_rest = true;
    }
}

static int16_t round_q8(int32_t value_q8)
{
    const uint32_t magnitude = (fix_abs_u32(value_q8) + 128U) >> 8;
    return fix_sat16(value_q8 < 0 ? -(int32_t)magnitude : (int32_t)magnitude);
}

/* The gyro's rate, less what is known of its errors. */
static int16_t measured_mrad_s(const heading_config_t *config, const signals_sensors_t *sensors)
{
    const int32_t rate_q8 = fix_sub16(sensors->yaw_rate_mrad_s, config->gyro_bias_mrad_s) * 256L;
    return round_q8(rate_q8 + fix_share_q15(rate_q8, config->gyro_scale_q15));
}

/* Turns by the mean of this step's rate and the one before, less the bias. */
static int16_t integrate(heading_state_t *state, const heading_input_t *input, int16_t measured)
{
    const signals_sensors_t *const sensors = input->sensors;
    const int32_t bias_q8 = state->bias_mrad_s_q8;
    const int16_t rate = SIGNALS_HAVE(sensors, SENSOR_GYRO)
                             ? measured
                             : fix_sat16(input->predicted_yaw_rate_mrad_s + (int32_t)round_q8(bias_q8));
    const int32_t twice = fix_mul(rate, sensors->period_ms) + fix_mul(state->raw_rate_mrad_s, sensors->period_ms);
    const int32_t twice_bias_q8 = 2 * fix_mul(state->bias_mrad_s_q8, sensors->period_ms);
    state->raw_rate_mrad_s = rate;
    state->heading_bam32 += (uint32_t)bam32_of(twice * 256 - twice_bias_q8);
    return round_q8((int32_t)rate * 256 - bias_q8);
}

void heading_step(const heading_config_t *config, heading_state_t *state, const heading_input_t *input,
                  heading_output_t *output)
{
    const signals_sensors_t *const sensors = input->sensors;
    const int16_t measured = measured_mrad_s(config, sensors);
    watch_rest(config, state, input, measured);
    output->yaw_rate_mrad_s = integrate(state, input, measured);
    if (SIGNALS_HAVE(sensors, SENSOR_REFERENCE)) {
        state->heading_bam32 = (uint32_t)sensors->reference_heading_bam16 << 16;
        output->yaw_rate_mrad_s = sensors->reference_yaw_rate_mrad_s;
    }
    if (SIGNALS_HAVE(sensors, SENSOR_GYRO | SENSOR_REFERENCE))
        state->blind_ms = 0;
    else
        state->blind_ms = (uint16_t)fix_clamp32((int32_t)state->blind_ms + sensors->period_ms, 65000L);
    output->heading_bam16 = fix_round_bam16(state->heading_bam32);
    output->at_rest = state->at_rest;
    output->bias_known = state->learnt_blocks > 0;
    output->valid = state->blind_ms <= config->blind_ms;
}
