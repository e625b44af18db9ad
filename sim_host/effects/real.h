/* real.h: the number type of the plant's equations.
 *
 * A file is compiled for one robot, or for LANES robots side by side. Then a real_t holds one value of each robot, in
 * the lanes of a vector register, and an operator acts on all of them. By IEEE 754 every operation gives the same in a
 * lane as alone, and functions of the C library are called lane by lane, so both give the same bits. A law that depends
 * on a condition computes all cases, then chooses one in each lane: `any_lane` and `all_lanes` say which can be left
 * out.
 */
#ifndef BRICKPILOT_EFFECTS_REAL_H
#define BRICKPILOT_EFFECTS_REAL_H

#include <math.h>
#include <stdbool.h>

#ifndef LANES
#define LANES 1
#endif

/* Functions on vectors are inlined into their callers, so that no vector is passed through memory. */
#define IN_LANES static inline __attribute__((always_inline))

/* For a long function that is seldom called for one robot. If inlined, it would take registers that its caller needs,
 * even when it is not called. */
#if LANES == 1
#define APART static __attribute__((noinline))
#else
#define APART static inline
#endif

#if LANES == 1

typedef double real_t;
typedef int mask_t; /* result of a comparison: 0 or 1 */

IN_LANES real_t real_of(double value)
{
    return value;
}
IN_LANES mask_t mask_of(int value)
{
    return value != 0;
}
IN_LANES int any_lane(mask_t mask)
{
    return mask;
}
IN_LANES int all_lanes(mask_t mask)
{
    return mask;
}
IN_LANES mask_t mask_not(mask_t mask)
{
    return !mask;
}
IN_LANES real_t choose(mask_t mask, real_t yes, real_t no)
{
    return mask ? yes : no;
}
IN_LANES real_t real_abs(real_t value)
{
    return fabs(value);
}
IN_LANES real_t real_signed(real_t size, real_t sign)
{
    return copysign(size, sign);
}
IN_LANES real_t real_exp(real_t value)
{
    return exp(value);
}
IN_LANES real_t real_root(real_t value)
{
    return sqrt(value);
}
IN_LANES real_t real_expm1(real_t value)
{
    return expm1(value);
}
IN_LANES real_t real_sin(real_t value)
{
    return sin(value);
}
IN_LANES real_t real_hypot(real_t a, real_t b)
{
    return hypot(a, b);
}
IN_LANES void real_turn(real_t angle, real_t *cosine, real_t *sine)
{
    *cosine = cos(angle);
    *sine = sin(angle);
}

#else

/* Vector types of gcc and clang: the compiler splits a vector that is wider than the processor's registers. */
typedef double real_t __attribute__((vector_size(8 * LANES)));
typedef __typeof__((real_t){0} < (real_t){0}) mask_t; /* result of a comparison: each lane 0 or all bits */

IN_LANES real_t real_of(double value)
{
    real_t result = {0};
    for (int i = 0; i < LANES; i++)
        result[i] = value; /* not 0 + value, which turns -0 into 0 */
    return result;
}
IN_LANES mask_t mask_of(int value)
{
    return real_of(value) != 0;
}
IN_LANES int any_lane(mask_t mask)
{
    long long bits = 0;
    for (int i = 0; i < LANES; i++)
        bits |= mask[i];
    return bits != 0;
}
IN_LANES int all_lanes(mask_t mask)
{
    long long bits = -1;
    for (int i = 0; i < LANES; i++)
        bits &= mask[i];
    return bits != 0;
}
IN_LANES mask_t mask_not(mask_t mask)
{
    return ~mask;
}
IN_LANES real_t choose(mask_t mask, real_t yes, real_t no)
{
#ifdef __clang__ /* with AVX-512, clang 14 merges the bit operations below into a wrong operation */
    real_t result = no;
    for (int i = 0; i < LANES; i++)
        result[i] = mask[i] != 0 ? yes[i] : no[i];
    return result;
#else
    return (real_t)((mask & (mask_t)yes) | (~mask & (mask_t)no));
#endif
}
IN_LANES real_t real_abs(real_t value)
{
    return (real_t)((mask_t)value & ~(mask_t)real_of(-0.0));
}
IN_LANES real_t real_signed(real_t size, real_t sign)
{
    const mask_t bit = (mask_t)real_of(-0.0);
    return (real_t)(((mask_t)size & ~bit) | ((mask_t)sign & bit));
}
IN_LANES real_t real_exp(real_t value)
{
    real_t result = value;
    for (int i = 0; i < LANES; i++)
        result[i] = exp(value[i]);
    return result;
}
IN_LANES real_t real_root(real_t value)
{
    real_t result = value;
    for (int i = 0; i < LANES; i++)
        result[i] = sqrt(value[i]);
    return result;
}
IN_LANES real_t real_expm1(real_t value)
{
    real_t result = value;
    for (int i = 0; i < LANES; i++)
        result[i] = expm1(value[i]);
    return result;
}
IN_LANES real_t real_sin(real_t value)
{
    real_t result = value;
    for (int i = 0; i < LANES; i++)
        result[i] = sin(value[i]);
    return result;
}
IN_LANES real_t real_hypot(real_t a, real_t b)
{
    real_t result = a;
    for (int i = 0; i < LANES; i++)
        result[i] = hypot(a[i], b[i]);
    return result;
}
IN_LANES void real_turn(real_t angle, real_t *cosine, real_t *sine)
{
    real_t cosines = angle, sines = angle;
    for (int i = 0; i < LANES; i++) {
        const double one = angle[i];
        const double of_cosine = cos(one), of_sine = sin(one); /* compilers merge both into one call */
        cosines[i] = of_cosine;
        sines[i] = of_sine;
    }
    *cosine = cosines;
    *sine = sines;
}

#endif

/* The smaller of `value` and `limit`; `limit` if the value is NaN. */
IN_LANES real_t real_least(real_t value, real_t limit)
{
    return choose(value < limit, value, limit);
}
/* The larger of `value` and `limit`; `limit` if the value is NaN. */
IN_LANES real_t real_most(real_t value, real_t limit)
{
    return choose(value > limit, value, limit);
}
IN_LANES real_t real_sign(real_t value)
{
    return choose(value > 0, real_of(1), choose(value < 0, real_of(-1), real_of(0)));
}
IN_LANES mask_t is_nan(real_t value)
{
    return value != value;
}

#endif
