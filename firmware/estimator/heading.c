#include "estimator/heading.h"

#include "core/fix.h"

/* bam32 per mrad/s, ms and 2^-9: 2^32 / (2 pi 1e6 2^9) = 1.335089, less 1. */
enum { BAM32_PER_MRAD_Q9_LESS_1_Q15 = 10980, BLIND_LIMIT_MS = 65000 };

/* The gyro's rate, less what is known of its errors. */
static int16_t measured_mrad_s(const heading_config_t *config, int16_t gyro_mrad_s)
{
    const int32_t rate_q8 = fix_sub16(gyro_mrad_s, config->gyro_bias_mrad_s) * 256L;
    return fix_round16(rate_q8 + fix_share_q15(rate_q8, config->gyro_scale_q15), 8);
}

static bool moves(const heading_config_t *config, heading_state_t *state, const signals_state_t *signals)
{
    const signals_sensors_t *const sensors = &signals->sensors;
    bool counted = false;
    if (SIGNALS_HAVE(sensors, SENSOR_ROTATION)) {
        counted = sensors->rotation_left != state->rotation_left || sensors->rotation_right != state->rotation_right;
        state->rotation_left = sensors->rotation_left;
        state->rotation_right = sensors->rotation_right;
    }
    return counted || signals->driven || !SIGNALS_HAVE(sensors, SENSOR_GYRO) ||
           fix_abs_u16(fix_round16(signals->predicted->surge_mm_s_q17, 13)) > config->rest_speed_mm_s_q4;
}

static void learn_block(const heading_config_t *config, heading_state_t *state)
{
    const int32_t mean_q8 = state->block_sum_mrad_s * (256 / HEADING_BLOCK_STEPS);
    const int32_t error_q8 = mean_q8 - state->bias_mrad_s_q8;
    const uint8_t bits = fix_bits(state->learnt_blocks, config->slowest_weight_bits);
    const int16_t bias_q8 = fix_sat16(state->bias_mrad_s_q8 + fix_fraction(error_q8, bits));
    state->bias_mrad_s_q8 = fix_clamp16(bias_q8, HEADING_BIAS_LIMIT_MRAD_S * 256);
    if (state->learnt_blocks < 255)
        state->learnt_blocks++;
}

/* Returns whether the robot is at rest. */
static bool watch_rest(const heading_config_t *config, heading_state_t *state, const signals_state_t *signals,
                       int16_t rate)
{
    if (state->block_steps == 0)
        state->block_least_mrad_s = state->block_most_mrad_s = rate;
    if (rate < state->block_least_mrad_s)
        state->block_least_mrad_s = rate;
    if (rate > state->block_most_mrad_s)
        state->block_most_mrad_s = rate;
    const uint16_t spread = (uint16_t)state->block_most_mrad_s - (uint16_t)state->block_least_mrad_s;
    if (moves(config, state, signals) || spread > config->quiet_mrad_s) {
        state->block_steps = 0;
        state->block_sum_mrad_s = 0;
        return false;
    }
    state->block_sum_mrad_s += rate;
    if (++state->block_steps < HEADING_BLOCK_STEPS)
        return signals->at_rest;
    learn_block(config, state);
    state->block_steps = 0;
    state->block_sum_mrad_s = 0;
    return true;
}

/* Turns by the mean of this step's rate and the one before, less the bias. */
static void integrate(heading_state_t *state, int16_t rate_mrad_s, uint8_t period_ms)
{
    const int32_t twice = (int32_t)rate_mrad_s + state->raw_rate_mrad_s;
    const int32_t angle_urad_q9 = fix_times(twice * 256 - 2 * (int32_t)state->bias_mrad_s_q8, period_ms);
    state->heading_bam32 += (uint32_t)(angle_urad_q9 + fix_share_q15(angle_urad_q9, BAM32_PER_MRAD_Q9_LESS_1_Q15));
    state->raw_rate_mrad_s = rate_mrad_s;
}

void heading_step(const heading_config_t *config, heading_state_t *state, signals_state_t *signals)
{
    const signals_sensors_t *const sensors = &signals->sensors;
    int16_t rate = measured_mrad_s(config, sensors->yaw_rate_mrad_s);

    signals->at_rest = watch_rest(config, state, signals, rate);
    state->blind_ms = fix_add_u16(state->blind_ms, sensors->period_ms);
    if (state->blind_ms > BLIND_LIMIT_MS)
        state->blind_ms = BLIND_LIMIT_MS;
    if (SIGNALS_HAVE(sensors, SENSOR_GYRO | SENSOR_REFERENCE))
        state->blind_ms = 0;
    if (!SIGNALS_HAVE(sensors, SENSOR_GYRO))
        rate =
            fix_add16(fix_round16(signals->predicted->yaw_rate_mrad_s_q12, 12), fix_round16(state->bias_mrad_s_q8, 8));
    integrate(state, rate, sensors->period_ms);
    signals->yaw_rate_mrad_s = fix_round16((int32_t)rate * 256 - state->bias_mrad_s_q8, 8);
    if (SIGNALS_HAVE(sensors, SENSOR_REFERENCE)) {
        state->heading_bam32 = (uint32_t)sensors->reference_heading_bam16 << 16;
        signals->yaw_rate_mrad_s = sensors->reference_yaw_rate_mrad_s;
    }
    signals->heading_bam16 = fix_round_bam16(state->heading_bam32);
    signals->valid = state->blind_ms <= config->blind_ms;
}
