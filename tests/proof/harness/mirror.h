/* mirror.h: products of fix.h as any functions that are odd in each factor. A symmetry that holds for all of these
 * holds for the real functions, which are odd too: fix.c compares them with formulas of magnitude and sign. */
#ifndef PROOF_MIRROR_H
#define PROOF_MIRROR_H

#include "contracts.h"
#include "core/fix.h"

uint32_t __CPROVER_uninterpreted_product(uint32_t, uint32_t);
uint32_t __CPROVER_uninterpreted_share(uint32_t, uint32_t);
uint32_t __CPROVER_uninterpreted_gain(uint32_t, uint32_t);

static int32_t odd(bool zero, bool negative, uint32_t magnitude, uint32_t most)
{
    ASSUME(magnitude <= most && (!zero || magnitude == 0));
    return negative ? -(int32_t)magnitude : (int32_t)magnitude;
}

static int32_t odd_mul(int16_t a, int16_t b)
{
    return odd(a == 0 || b == 0, (a < 0) != (b < 0), __CPROVER_uninterpreted_product(fix_abs_u16(a), fix_abs_u16(b)),
               1073741824UL);
}

static int32_t odd_share_q16(int32_t value, uint16_t factor)
{
    const uint32_t whole = fix_abs_u32(value);
    ASSERT(factor <= 20973U); /* the factor of 20 ms: less than three eighths */
    return odd(value == 0, value < 0, __CPROVER_uninterpreted_share(whole, factor), (whole >> 2) + (whole >> 3) + 1);
}

static int32_t odd_gain_q10(int16_t gain, int16_t value)
{
    return odd(gain == 0 || value == 0, (gain < 0) != (value < 0),
               __CPROVER_uninterpreted_gain(fix_abs_u16(gain), fix_abs_u16(value)), 1048576UL);
}

#endif
