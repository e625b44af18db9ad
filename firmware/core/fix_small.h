/* fix_small.h: the bodies of fix.h's small functions, inline. Only fix.h includes this file, at its end. The RCX does
 * not use it: core/h8 has these functions in assembly. */
#ifndef BRICKPILOT_CORE_FIX_SMALL_H
#define BRICKPILOT_CORE_FIX_SMALL_H

FIX_INLINE uint32_t fix_mul_u16(uint16_t a, uint16_t b)
{
    return (uint32_t)a * b;
}

FIX_INLINE uint32_t fix_abs_u32(int32_t value)
{
    return value < 0 ? 0UL - (uint32_t)value : (uint32_t)value;
}

FIX_INLINE int32_t fix_mul(int16_t a, int16_t b)
{
    return (int32_t)a * b;
}

FIX_INLINE int32_t fix_add(int16_t a, int16_t b)
{
    return (int32_t)a + b;
}

FIX_INLINE int16_t fix_sat16(int32_t value)
{
    return value > 32767L ? (int16_t)32767 : value < -32767L ? (int16_t)-32767 : (int16_t)value;
}

FIX_INLINE int16_t fix_add16(int16_t a, int16_t b)
{
    return fix_sat16((int32_t)a + b);
}

FIX_INLINE int16_t fix_sub16(int16_t a, int16_t b)
{
    return fix_sat16((int32_t)a - b);
}

FIX_INLINE int32_t fix_clamp32(int32_t value, int32_t limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

FIX_INLINE int32_t fix_round_shift(int32_t value, uint8_t bits)
{
    const uint32_t magnitude = (fix_abs_u32(value) + ((uint32_t)1 << (bits - 1))) >> bits;
    return value < 0 ? -(int32_t)magnitude : (int32_t)magnitude;
}

FIX_INLINE int32_t fix_mul_q10(int16_t gain_q10, int16_t value)
{
    return fix_round_shift(fix_mul(gain_q10, value), 10);
}

FIX_INLINE uint16_t fix_abs_u16(int16_t value)
{
    return value < 0 ? (uint16_t)(0U - (uint16_t)value) : (uint16_t)value;
}

FIX_INLINE int16_t fix_clamp16(int16_t value, int16_t limit)
{
    return value > limit ? limit : value < -limit ? (int16_t)-limit : value;
}

FIX_INLINE uint16_t fix_increment_u16(uint16_t count)
{
    return count < 65535U ? (uint16_t)(count + 1U) : count;
}

FIX_INLINE uint16_t fix_add_u16(uint16_t a, uint16_t b)
{
    const uint16_t sum = (uint16_t)(a + b);
    return sum < a ? (uint16_t)65535U : sum;
}

#endif
