#include "estimator/heading.h"

#include "core/fix.h"

/* bam32 per mrad/s, ms and 2^-9: 2^32 / (2 pi 1e6 2^9) = 1.335089, less 1. */
enum { BAM32_PER_MRAD_Q9_LESS_1_Q15 = 10980, BLIND_LIMIT_MS = 65000 };

/* The gyro's rate, less what is known of its errors. */
static int16_t measured_mrad_s(const heading_config_t *config, int16_t gyro_mrad_s)
{
    const int16_t rate_mrad_s = fix_sub16(gyro_mrad_s, config->gyro_bias_mrad_s);
    if (config->gyro_scale_q15 == 0)
        return rate_mrad_s;
    const int32_t rate_q8 = fix_q8(rate_mrad_s);
    return fix_round16(rate_q8 + fix_share_q15(rate_q8, config->gyro_scale_q15), 8);
}

/* Whether the robot stands still, by all but the gyro. */
static bool stands(const heading_config_t *config, heading_state_t *state, const signals_state_t *signals)
{
    bool counted = false;
    if (SIGNALS_HAVE(signals, SENSOR_ROTATION)) {
        const uint16_t left = signals->sensors.rotation_left, right = signals->sensors.rotation_right;
        counted = left != state->rotation_left || right != state->rotation_right;
        state->rotation_left = left;
        state->rotation_right = right;
    }
    return !counted && !signals->driven &&
           fix_abs_u16(fix_round16(signals->predicted->surge_mm_s_q17, 13)) <= config->rest_speed_mm_s_q4;
}

/* Takes a rate into the block; whether all of the block is alike. */
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
    fix_add_to(rate, &state->block_sum_mrad_s);
    return (uint16_t)((uint16_t)most - (uint16_t)least) <= config->quiet_mrad_s;
}

static void watch_rest(const heading_config_t *config, heading_state_t *state, signals_state_t *signals, int16_t rate)
{
    if (!stands(config, state, signals) || !SIGNALS_HAVE(signals, SENSOR_GYRO) || !quiet(config, state, rate)) {
        state->block_steps = 0;
        signals->at_rest = false;
    } else if (++state->block_steps == HEADING_BLOCK_STEPS) {
        bias_learn(&state->bias, fix_times(state->block_sum_mrad_s, 256 / HEADING_BLOCK_STEPS),
                   config->slowest_weight_bits, HEADING_BIAS_LIMIT_MRAD_S * 256L);
        state->block_steps = 0;
        signals->at_rest = true;
    }
}

static int32_t unbiased_mrad_s_q8(const heading_state_t *state, int16_t rate_mrad_s)
{
    return fix_less(fix_q8(rate_mrad_s), &state->bias.value);
}

/* Turns by the mean of this step's rate and the one before, less the bias. */
static void integrate(heading_state_t *state, signals_state_t *signals, int16_t rate_mrad_s)
{
    const int32_t now_q8 = unbiased_mrad_s_q8(state, rate_mrad_s);
    signals->yaw_rate_mrad_s = fix_round16(now_q8, 8);
    const int32_t twice_q8 = now_q8 + unbiased_mrad_s_q8(state, state->raw_rate_mrad_s);
    const int32_t angle_urad_q9 = fix_times(twice_q8, signals->sensors.period_ms);
    state->heading_bam32 += (uint32_t)(angle_urad_q9 + fix_share_q15(angle_urad_q9, BAM32_PER_MRAD_Q9_LESS_1_Q15));
    state->raw_rate_mrad_s = rate_mrad_s;
}

void heading_step(const heading_config_t *config, heading_state_t *state, signals_state_t *signals)
{
    int16_t rate;

    if (SIGNALS_HAVE(signals, SENSOR_GYRO)) {
        rate = measured_mrad_s(config, signals->sensors.yaw_rate_mrad_s);
        state->blind_ms = 0;
    } else {
        rate = fix_add16(fix_round16(signals->predicted->yaw_rate_mrad_s_q12, 12), fix_round16(state->bias.value, 8));
        state->blind_ms = (uint16_t)(state->blind_ms + signals->sensors.period_ms);
        if (state->blind_ms > BLIND_LIMIT_MS)
            state->blind_ms = BLIND_LIMIT_MS;
    }
    watch_rest(config, state, signals, rate);
    integrate(state, signals, rate);
    if (SIGNALS_HAVE(signals, SENSOR_REFERENCE)) {
        state->heading_bam32 = (uint32_t)signals->sensors.reference_heading_bam16 << 16;
        signals->yaw_rate_mrad_s = signals->sensors.reference_yaw_rate_mrad_s;
        state->blind_ms = 0;
    }
    signals->valid = state->blind_ms <= config->blind_ms;
    signals->heading_bam16 = fix_round_bam16(state->heading_bam32);
}
