/* fix.h: saturating fixed-point arithmetic. It needs no library call, not even on the RCX.
 *
 * The RCX's compiler turns every `*` wider than 8 x 8 bits and every `/` into a library call that the brick does not
 * have. So this file computes all products and quotients of variables in firmware/. Shifts are by constants. Right
 * shifts of negative numbers are arithmetic (they round towards minus infinity) with every compiler in use; test_fix.c
 * checks it.
 *
 * Beware: the RCX's compiler, gcc 3.4.6, makes wrong code for some right shifts of 32-bit numbers: by 15, and of signed
 * numbers by 24 to 26. The code is also wrong if the compiler merges two shifts into one of these. Use the two 16-bit
 * words of the number instead. tests/vectors finds such errors.
 */
#ifndef BRICKPILOT_CORE_FIX_H
#define BRICKPILOT_CORE_FIX_H

#include <stdbool.h>
#include <stdint.h>

/* FIX_IN_ASSEMBLY: on the RCX most functions are in assembly, in core/h8; the C code defines the right results.
 * FIX_INLINE: makes the small functions inline, except on the RCX, where each use would take 20 to 100 bytes. */
#ifdef __H8300__
#define FIX_IN_ASSEMBLY
#define FIX_INLINE
#else
#define FIX_INLINE static inline
#endif

#define FIX_INT16_MAX 32767
#define FIX_INT32_MAX 2147483647L

/* A vector in the plane, or the unit vector of a direction in q15: its cosine and sine. */
typedef struct {
    int16_t x;
    int16_t y;
} fix_vector_t;

/* Exact product of unsigned numbers; any operands. */
FIX_INLINE uint32_t fix_mul_u16(uint16_t a, uint16_t b);

FIX_INLINE uint16_t fix_abs_u16(int16_t value);
FIX_INLINE uint32_t fix_abs_u32(int32_t value);

/* Exact signed product and sum of any operands: the product is at most 2^30 in magnitude. */
FIX_INLINE int32_t fix_mul(int16_t a, int16_t b);
FIX_INLINE int32_t fix_add(int16_t a, int16_t b);

/* Exact scalar product; no component is -32768. */
int32_t fix_dot(const fix_vector_t *of, const fix_vector_t *with);

/* The projection of `of` on a direction: the scalar product / 2^15, to the nearest, halves away from zero, saturated. */
int16_t fix_project(const fix_vector_t *of, const fix_vector_t *direction_q15);

/* Compares `value`, 0..2^31-1, with the square of `root`, 0..32768. Returns less than 0, 0, or more than 0. */
int16_t fix_compare_square(int32_t value, uint16_t root);

/* Saturating conversions and sums; any operands. */
FIX_INLINE int16_t fix_sat16(int32_t value);
int32_t fix_add32(int32_t a, int32_t b);
int32_t fix_sub32(int32_t a, int32_t b);
FIX_INLINE int16_t fix_add16(int16_t a, int16_t b);
FIX_INLINE int16_t fix_sub16(int16_t a, int16_t b);

/* `value` limited to -limit..limit; limit 0..2^31-1. */
FIX_INLINE int32_t fix_clamp32(int32_t value, int32_t limit);
FIX_INLINE int16_t fix_clamp16(int16_t value, int16_t limit);

/* `value` limited to -limit * 65536..limit * 65536; limit 0..32767. */
int32_t fix_clamp_q16(int32_t value, int16_t limit);

/* value / 2^bits, rounded to the nearest, halves away from zero: fix_round_shift(-v, n) = -fix_round_shift(v, n).
 * Any value; bits 1..30, a constant. */
FIX_INLINE int32_t fix_round_shift(int32_t value, uint8_t bits);

/* As fix_round_shift(), saturated to 16 bits; bits 8..30. */
int16_t fix_round_shift16(int32_t value, uint8_t bits);

/* gain * value, rounded to the nearest, halves away from zero; fix_mul16_q10() also saturates. gain 0..32767, value any. */
FIX_INLINE int32_t fix_mul_q10(int16_t gain_q10, int16_t value);
int16_t fix_mul16_q10(int16_t gain_q10, int16_t value);

/* value * 256. */
int32_t fix_to_q8(int16_t value);

/* value * factor; the product must fit into 32 bits. */
int32_t fix_mul32_u8(int32_t value, uint8_t factor);

/* 1 / value: 32768 / value to the nearest, at most 32767; value 1..255. */
int16_t fix_reciprocal_q15(uint8_t value);

/* The number of significant bits of `count`, 0..16, limited to `most`. bias.c gives its newest sample the weight
 * 2^-bits. */
uint8_t fix_bit_length(uint16_t count, uint8_t most);

/* count + 1, saturated at 65535. */
FIX_INLINE uint16_t fix_increment_u16(uint16_t count);

/* Returns the sign of a - b: 1, 0 or -1. */
int8_t fix_compare16(int16_t a, int16_t b);

/* a + b, saturated at 65535. */
FIX_INLINE uint16_t fix_add_u16(uint16_t a, uint16_t b);

/* (a * b) >> 16 with the full 48-bit product, rounded down. Any operands: the result always fits. */
uint32_t fix_mul_u32_q16(uint32_t a, uint16_t b);

/* value * factor / 2^15 rounded towards zero: negating one operand negates the result. Saturates at +-(2^31 - 1). */
int32_t fix_mul_q15(int32_t value, int16_t factor_q15);

/* As fix_mul_q15(), saturated at +-32767. */
int16_t fix_mul16_q15(int16_t value, int16_t factor_q15);

/* value * factor / 2^16 rounded towards zero: negating value negates the result. Any operands: the result fits. */
int32_t fix_mul_q16(int32_t value, uint16_t factor_q16);

/* value / 1000, saturated. Computed as value * 16777 / 2^24, which is too small by 13 parts in a million, and rounded
 * to the nearest, halves away from zero. */
int16_t fix_div_1000(int32_t value);

/* value / 2^bits rounded towards zero; bits 0..31. */
int32_t fix_trunc_shift(int32_t value, uint8_t bits);

/* Rounds an angle in units of 1/2^32 turn to the nearest 1/65536 turn, halves away from zero. */
uint16_t fix_round_bam16(uint32_t angle_bam32);

/* dividend / divisor, rounded towards zero. Divisor 0 gives 2^32 - 1. */
uint32_t fix_div_u32(uint32_t dividend, uint16_t divisor);

/* Integer square root, rounded down. Any operand. */
uint16_t fix_sqrt_u32(uint32_t value);

/* Difference of two binary angles, wrapped: -32768..32767 for a - b. */
static inline int16_t fix_angle_diff_bam16(uint16_t a, uint16_t b)
{
    return (int16_t)(uint16_t)(a - b);
}

#ifndef FIX_IN_ASSEMBLY
#include "core/fix_small.h"
#endif

#endif
