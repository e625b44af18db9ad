/* abstract.h: any products and quotients that have the properties which a proof needs. The proofs in fix.c and scale.c
 * show that the real functions have them. A harness includes this file before the module that it proves, so that the
 * module calls these functions.
 */
#ifndef PROOF_ABSTRACT_H
#define PROOF_ABSTRACT_H

#include "contracts.h"
#include "core/fix.h"

/* fix_mul_q15() for factors of at most 32767 in size: fix_mul_q15_bounds() in fix.c proves the bound. */
static int32_t open_share_q15(int32_t value, int16_t factor_q15)
{
    const uint32_t whole = fix_abs_u32(value);
    uint32_t share;

    ASSERT(factor_q15 >= -32767);
    ASSUME(share <= whole - (whole >> 15) && share <= FIX_INT32_MAX);
    return (value < 0) != (factor_q15 < 0) ? -(int32_t)share : (int32_t)share;
}

static int16_t open_share16_q15(int16_t value, int16_t factor_q15)
{
    return fix_sat16(open_share_q15(value, factor_q15));
}

/* fix_mul_u16() for factors b of at most 32767, and fix_mul(). */
static uint16_t open_factor;
static uint32_t open_product;

static uint32_t open_mul_u16(uint16_t a, uint16_t b)
{
    uint32_t product;

    ASSERT(b <= 32767U);
    ASSUME(product <= 65535UL * 32767UL);
    open_factor = a;
    open_product = product;
    return product;
}

static int32_t open_mul(int16_t a, int16_t b)
{
    int32_t product;

    (void)a;
    (void)b;
    ASSUME(UP_TO(1073741824L, product));
    return product;
}

/* fix_div_u32() of the newest such product p <= a * 32767. By algebra p / 32767 is at most a; and for a <= divisor, (p
 * + at most half a divisor) / divisor is below 32768. */
static uint32_t open_div_u32(uint32_t dividend, uint16_t divisor)
{
    uint32_t quotient;

    ASSERT(divisor != 0 && dividend >= open_product);
    if (divisor == FIX_INT16_MAX)
        ASSUME(dividend != open_product || quotient <= open_factor);
    else
        ASSUME(open_factor > divisor || dividend - open_product > divisor / 2U || quotient <= 32767);
    return quotient;
}

/* Sines, cosines and arc tangents: trig.c proves their ranges. */
static int16_t open_cosine(uint16_t angle)
{
    int16_t any;
    (void)angle;
    ASSUME(any >= -32767);
    return any;
}

static uint16_t open_angle(int32_t y, int32_t x)
{
    uint16_t any;
    (void)y;
    (void)x;
    return any;
}

#endif
