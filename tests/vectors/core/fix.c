#include "core/fix.h"

#include "vectors.h"

static void feed_16(int16_t a, int16_t b, int32_t wide)
{
    hash_u32(fix_mul_u16((uint16_t)a, (uint16_t)b));
    hash_s32(fix_mul(a, b));
    hash_s32(fix_add(a, b));
    hash_u16(fix_abs_u16(a));
    hash_s32(fix_to_q8(a));
    hash_s16(fix_sat16(wide));
    hash_s16(fix_add16(a, b));
    hash_s16(fix_sub16(a, b));
    hash_s16(fix_clamp16(a, (int16_t)(b & 0x7FFF)));
    hash_u16(fix_increment_u16((uint16_t)a));
    hash_u8((uint8_t)fix_compare16(a, b));
    hash_s32(fix_mul_q10((int16_t)(a & 0x7FFF), b));
    hash_s16(fix_mul16_q10((int16_t)(a & 0x7FFF), b));
    hash_u16(fix_add_u16((uint16_t)a, (uint16_t)b));
    hash_s16(fix_mul16_q15(a, b));
    hash_s16(fix_angle_diff_bam16((uint16_t)a, (uint16_t)b));
}

static void feed_32(int32_t a, int32_t b)
{
    hash_u32(fix_abs_u32(a));
    hash_s32(fix_clamp32(a, b & 0x7FFFFFFFL));
    hash_s32(fix_sub32(a, b));
    hash_s32(fix_add32(a, b));
    hash_s32(fix_add32(b, a));
    hash_u16(fix_round_bam16((uint32_t)a));
    hash_u16(fix_sqrt_u32((uint32_t)a));
}

static int16_t at_most_32767(int16_t value)
{
    return value < -32767 ? (int16_t)-32767 : value;
}

static void feed_pairs(int16_t a, int16_t b, int32_t wide)
{
    const fix_vector_t of = {at_most_32767(a), at_most_32767((int16_t)wide)};
    const fix_vector_t with = {at_most_32767(b), at_most_32767((int16_t)(wide >> 16))};
    const int32_t value = wide & 0x7FFFFFFFL;
    const int16_t sign = fix_compare_square(value, draw_up_to(32768U));

    hash_s32(fix_dot(&of, &with));
    hash_s16(fix_project(&of, &with));
    hash_u8((uint8_t)((sign < 0) + 2 * (sign > 0)));
    hash_s16(fix_div_1000(wide));
}

static void feed_shifts(int32_t value, uint8_t bits)
{
    hash_s32(fix_trunc_shift(value, bits));
    if (bits > 0 && bits < 31)
        hash_s32(fix_round_shift(value, bits));
    if (bits >= 8 && bits < 31)
        hash_s16(fix_round_shift16(value, bits));
}

static void feed_mixed(int32_t a, int16_t b)
{
    hash_u32(fix_mul_u32_q16((uint32_t)a, (uint16_t)b));
    hash_s32(fix_mul_q15(a, b));
    hash_s32(fix_mul_q16(a, (uint16_t)b));
    hash_u32(fix_div_u32((uint32_t)a, (uint16_t)b));
    hash_s32(fix_clamp_q16(a, (int16_t)(b & 0x7FFF)));
    hash_u8(fix_bit_length((uint16_t)b, (uint8_t)a & 31U));
    hash_s32(fix_mul32_u8(a, (uint8_t)b));
    if ((uint8_t)b != 0)
        hash_s16(fix_reciprocal_q15((uint8_t)b));
}

void vectors_feed(void)
{
    const int32_t a = draw_s32(), b = draw_s32();
    const int16_t c = draw_s16(), d = draw_s16();

    feed_16(c, d, a);
    feed_32(a, b);
    feed_shifts(b, (uint8_t)(draw_u16() & 31U));
    feed_mixed(a, c);
    feed_pairs(c, d, b);
}
