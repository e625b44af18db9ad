/* body_parts.h: helper functions of body.c and body_pose.c. No other file includes it. */
#ifndef BRICKPILOT_MODEL_BODY_PARTS_H
#define BRICKPILOT_MODEL_BODY_PARTS_H

#include "core/fix.h"
#include "core/trig.h"
#include "model/body.h"

typedef struct {
    int16_t cos_q15;
    int16_t sin_q15;
} direction_t;

static inline uint16_t rounded_heading_bam16(const body_state_t *state)
{
    return fix_round_bam16(state->heading_bam32);
}

static inline direction_t direction_of(uint16_t angle_bam16)
{
    return (direction_t){.cos_q15 = trig_cos_q15(angle_bam16), .sin_q15 = trig_sin_q15(angle_bam16)};
}

/* value * factor / 2^(15 + bits), rounded to the nearest. */
static inline int32_t part(int32_t value, int16_t factor_q15, uint8_t bits)
{
    const scale_t factor = {.mantissa = factor_q15, .shift = bits};
    return scale_apply(&factor, value);
}

static inline int32_t half(int32_t value)
{
    return value < 0 ? -(-value >> 1) : value >> 1;
}
static inline int32_t middle(int32_t before, int32_t after)
{
    return before + half(after - before);
}

/* Turns the heading by the mean of the yaw rates before and after the step: the yaw rate is taken to change linearly.
 * Returns the heading in the middle of the step. */
static inline uint16_t turn(const body_coefficients_t *coefficients, body_state_t *state, int32_t before_mrad_s_q12)
{
    const int32_t mean = middle(before_mrad_s_q12, state->motion.yaw_rate_mrad_s_q12);
    const int32_t turned = scale_apply(&coefficients->heading_from_yaw_rate, mean);
    const uint16_t middle_bam16 = fix_round_bam16(state->heading_bam32 + (uint32_t)half(turned));
    state->heading_bam32 += (uint32_t)turned;
    return middle_bam16;
}

#endif
