#include "core/fix.h"

#ifndef FIX_IN_ASSEMBLY
#define BIT31 0x80000000UL

int32_t fix_add32(int32_t a, int32_t b)
{
    const uint32_t sum = (uint32_t)a + (uint32_t)b;
    const bool overflow = (a < 0) == (b < 0) && (sum >= BIT31) != (b < 0);

    if (overflow)
        return b < 0 ? -FIX_INT32_MAX : FIX_INT32_MAX;
    return sum == BIT31 ? -FIX_INT32_MAX : (int32_t)sum;
}

int32_t fix_sub32(int32_t a, int32_t b)
{
    const uint32_t difference = (uint32_t)a - (uint32_t)b;
    const bool overflow = (a < 0) != (b < 0) && (difference >= BIT31) != (a < 0);

    if (overflow)
        return a < 0 ? -FIX_INT32_MAX : FIX_INT32_MAX;
    return difference == BIT31 ? -FIX_INT32_MAX : (int32_t)difference;
}

int32_t fix_dot(const fix_vector_t *of, const fix_vector_t *with)
{
    return fix_mul(of->x, with->x) + fix_mul(of->y, with->y);
}

int16_t fix_compare_square(int32_t value, uint16_t root)
{
    const int32_t difference = value - (int32_t)fix_mul_u16(root, root);
    return difference < 0 ? -1 : difference > 0;
}

int32_t fix_clamp_q16(int32_t value, int16_t limit)
{
    return fix_clamp32(value, limit * 65536L);
}

int16_t fix_round_shift16(int32_t value, uint8_t bits)
{
    return fix_sat16(fix_round_shift(value, bits));
}

int16_t fix_mul16_q10(int16_t gain_q10, int16_t value)
{
    return fix_sat16(fix_mul_q10(gain_q10, value));
}

int32_t fix_to_q8(int16_t value)
{
    return (int32_t)value * 256;
}

int32_t fix_mul32_u8(int32_t value, uint8_t factor)
{
    return (int32_t)((uint32_t)value * factor);
}

int16_t fix_reciprocal_q15(uint8_t value)
{
    const uint16_t inverse = (uint16_t)((32768U + value / 2U) / value);
    return inverse > 32767U ? (int16_t)32767 : (int16_t)inverse;
}

uint8_t fix_bit_length(uint16_t count, uint8_t most)
{
    uint8_t bits = 0;
    for (; count > 0 && bits < most; count >>= 1)
        bits++;
    return bits;
}

uint32_t fix_mul_u32_q16(uint32_t a, uint16_t b)
{
    return fix_mul_u16((uint16_t)(a >> 16), b) + (fix_mul_u16((uint16_t)a, b) >> 16);
}

uint32_t fix_div_u32(uint32_t dividend, uint16_t divisor)
{
    return divisor == 0 ? UINT32_MAX : dividend / divisor;
}

uint16_t fix_sqrt_u32(uint32_t value)
{
    uint32_t root = 0;
    for (uint32_t bit = 1UL << 30; bit != 0; bit >>= 2) {
        const uint32_t trial = root + bit;
        root >>= 1;
        if (value >= trial) {
            value -= trial;
            root += bit;
        }
    }
    return (uint16_t)root;
}

int32_t fix_mul_q15(int32_t value, int16_t factor_q15)
{
    const uint32_t whole = fix_abs_u32(value);
    const uint16_t factor = fix_abs_u16(factor_q15);
    const uint32_t high = fix_mul_u16((uint16_t)(whole >> 16), factor);
    const uint32_t low = fix_mul_u16((uint16_t)whole, factor);
    const uint32_t product = (high << 1) + (uint16_t)((low << 1) >> 16);
    const int32_t magnitude = product < BIT31 ? (int32_t)product : FIX_INT32_MAX;
    return (value < 0) != (factor_q15 < 0) ? -magnitude : magnitude;
}

int8_t fix_compare16(int16_t a, int16_t b)
{
    if (a == b)
        return 0;
    return a > b ? 1 : -1;
}

int16_t fix_mul16_q15(int16_t value, int16_t factor_q15)
{
    return fix_sat16(fix_mul_q15(value, factor_q15));
}

int32_t fix_mul_q16(int32_t value, uint16_t factor_q16)
{
    const uint32_t magnitude = fix_mul_u32_q16(fix_abs_u32(value), factor_q16);
    return value < 0 ? -(int32_t)magnitude : (int32_t)magnitude;
}

int32_t fix_trunc_shift(int32_t value, uint8_t bits)
{
    const uint32_t magnitude = fix_abs_u32(value) >> bits;
    return (int32_t)(value < 0 ? 0U - magnitude : magnitude);
}

uint16_t fix_round_bam16(uint32_t angle_bam32)
{
    return (uint16_t)((angle_bam32 + (angle_bam32 < BIT31 ? 0x8000UL : 0x7FFFUL)) >> 16);
}
#endif

int16_t fix_project(const fix_vector_t *of, const fix_vector_t *direction_q15)
{
    return fix_round_shift16(fix_dot(of, direction_q15), 15);
}

int16_t fix_div_1000(int32_t value)
{
    return fix_round_shift16(fix_mul_q16(value, 16777), 8);
}
