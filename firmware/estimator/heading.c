#include "estimator/heading.h"

#include "core/fix.h"

/* bam32 per 2^-9 urad, where 1 urad = 1 mrad/s * 1 ms: 2^32 / (2 pi 1e6 2^9) = 1.335089; here minus 1. */
enum { BAM32_PER_MRAD_Q9_LESS_1_Q15 = 10980 };

/* The gyro's rate, without the known bias and scale error of the configuration. */
static int16_t measured_mrad_s(const heading_config_t *config, int16_t gyro_mrad_s)
{
    const int16_t rate_mrad_s = fix_sub16(gyro_mrad_s, config->gyro_bias_mrad_s);
    const int32_t rate_q8 = fix_to_q8(rate_mrad_s);
    return fix_round_shift16(rate_q8 + fix_mul_q15(rate_q8, config->gyro_scale_q15), 8);
}

/* True when rotation sensors and model say that the robot stands still. */
static bool stands(const heading_config_t *config, heading_state_t *state, const signals_sensors_t *sensors,
                   const signals_predicted_t *predicted)
{
    bool counted = false;
    if (SIGNALS_HAVE(sensors, SENSOR_ROTATION)) {
        const uint16_t left = sensors->rotation_left, right = sensors->rotation_right;
        counted = left != state->rotation_left || right != state->rotation_right;
        state->rotation_left = left;
        state->rotation_right = right;
    }
    return !counted && !predicted->driven &&
           fix_abs_u16(fix_round_shift16(predicted->motion.surge_mm_s_q17, 13)) <= config->rest_speed_mm_s_q4;
}

/* Adds a rate to the block. True while no two rates of the block differ by more than quiet_mrad_s. */
static bool quiet(const heading_config_t *config, heading_state_t *state, int16_t rate)
{
    int16_t least = state->block_least_mrad_s, most = state->block_most_mrad_s;
    if (state->block_steps == 0) {
        least = most = rate;
        state->block_sum_mrad_s = 0;
    }
    least = rate < least ? rate : least;
    most = rate > most ? rate : most;
    state->block_least_mrad_s = least;
    state->block_most_mrad_s = most;
    state->block_sum_mrad_s += rate;
    return (uint16_t)((uint16_t)most - (uint16_t)least) <= config->quiet_mrad_s;
}

/* Learns the gyro's bias from blocks of rates at rest. */
static void watch_rest(const heading_config_t *config, heading_state_t *state, const signals_sensors_t *sensors,
                       const signals_predicted_t *predicted, int16_t rate)
{
    if (stands(config, state, sensors, predicted)) {
        if (!SIGNALS_HAVE(sensors, SENSOR_GYRO))
            return; /* a missing sample says nothing about rest: the block goes on with the next sample */
        if (quiet(config, state, rate)) {
            if (++state->block_steps == HEADING_BLOCK_STEPS) {
                bias_learn(&state->bias, fix_mul32_u8(state->block_sum_mrad_s, 256 / HEADING_BLOCK_STEPS),
                           config->slowest_weight_bits, HEADING_BIAS_LIMIT_MRAD_S * 256L);
                state->block_steps = 0;
                state->at_rest = true;
            }
            return;
        }
    }
    state->block_steps = 0;
    state->at_rest = false;
}

/* Turns the heading by the mean of this rate and the previous rate, without bias. Returns this rate, without bias. */
static int16_t integrate(heading_state_t *state, uint8_t period_ms, int16_t rate_mrad_s)
{
    const int32_t twice_q8 = fix_add(rate_mrad_s, state->raw_rate_mrad_s) * 256 - 2 * state->bias.value;
    const int32_t angle_urad_q9 = fix_mul32_u8(twice_q8, period_ms);
    state->heading_bam32 += (uint32_t)(angle_urad_q9 + fix_mul_q15(angle_urad_q9, BAM32_PER_MRAD_Q9_LESS_1_Q15));
    state->raw_rate_mrad_s = rate_mrad_s;
    return fix_round_shift16(fix_to_q8(rate_mrad_s) - state->bias.value, 8);
}

/* The yaw rate of this step, gyro bias included: from the gyro, or from the model if the gyro gives none. */
static int16_t take_rate(const heading_config_t *config, heading_state_t *state, const signals_sensors_t *sensors,
                         const signals_predicted_t *predicted)
{
    if (SIGNALS_HAVE(sensors, SENSOR_GYRO)) {
        const int16_t gyro_mrad_s = sensors->yaw_rate_mrad_s;
        state->blind_ms = 0;
        if (!SIGNALS_HAVE(sensors, SENSOR_REFERENCE) && fix_abs_u16(gyro_mrad_s) >= config->gyro_full_mrad_s)
            state->full_steps = fix_increment_u16(state->full_steps);
        return measured_mrad_s(config, gyro_mrad_s);
    }
    state->blind_ms = fix_add_u16(state->blind_ms, sensors->period_ms);
    return fix_add16(fix_round_shift16(predicted->motion.yaw_rate_mrad_s_q12, 12),
                     fix_round_shift16(state->bias.value, 8));
}

void heading_step(const heading_config_t *config, heading_state_t *state, const signals_sensors_t *sensors,
                  const signals_predicted_t *predicted, signals_estimate_t *estimate)
{
    const int16_t rate = take_rate(config, state, sensors, predicted);

    watch_rest(config, state, sensors, predicted, rate);
    estimate->yaw_rate_mrad_s = integrate(state, sensors->period_ms, rate);
    estimate->bias_unknown = state->bias.learnt == 0;
    estimate->at_rest = state->at_rest;
    if (SIGNALS_HAVE(sensors, SENSOR_REFERENCE)) {
        estimate->bias_unknown = false;
        state->heading_bam32 = (uint32_t)sensors->reference_heading_bam16 << 16;
        estimate->yaw_rate_mrad_s = sensors->reference_yaw_rate_mrad_s;
        state->blind_ms = 0;
    }
    estimate->heading_bam16 = fix_round_bam16(state->heading_bam32);
    estimate->valid = state->blind_ms <= config->blind_ms;
}
