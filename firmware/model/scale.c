#include "model/scale.h"

#include "core/fix.h"

#ifndef FIX_IN_ASSEMBLY
static int32_t with_sign(uint32_t magnitude, int negative)
{
    return negative ? -(int32_t)magnitude : (int32_t)magnitude;
}

/* value / 2^bits, rounded to the nearest, halves up; bits 1 or more, value below 2^32 - 1. */
static uint32_t shift_right(uint32_t value, uint8_t bits)
{
    return ((value >> (bits - 1)) + 1) >> 1;
}

int32_t scale_apply(const scale_t *scale, int32_t value)
{
    const uint32_t magnitude = fix_abs_u32(value);
    const uint16_t mantissa = fix_abs_u16(scale->mantissa);
    const uint32_t high = fix_mul_u16((uint16_t)(magnitude >> 16), mantissa); /* below 2^30 */
    const uint32_t low = fix_mul_u16((uint16_t)magnitude, mantissa);          /* below 2^31 */
    const uint32_t low_q1 = low << 1;
    const uint32_t twice =
        (high << 2) + ((uint32_t)(uint16_t)(low_q1 >> 16) << 1) + ((low_q1 & 0x8000U) != 0 ? 1U : 0U);
    return with_sign(shift_right(twice, (uint8_t)(scale->shift + 1)), (value < 0) != (scale->mantissa < 0));
}

int32_t scale_apply16(const scale_t *scale, int16_t value)
{
    const uint32_t product = fix_mul_u16(fix_abs_u16(value), fix_abs_u16(scale->mantissa));
    return with_sign(shift_right(product << 1, (uint8_t)(scale->shift + 1)), (value < 0) != (scale->mantissa < 0));
}
#endif
