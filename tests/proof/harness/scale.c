/* Proves that scale_apply() and scale_apply16() give the exact product, rounded to the nearest, and that the result
 * grows with the value. The two products of 16 by 16 bits are any numbers, as in fix.c. */
#include "contracts.h"
#include "core/fix.h"

typedef unsigned long long uwide_t;
static uint16_t factors[2];
static uint32_t products[2];
static uint8_t made;

static uint32_t open_product(uint16_t a, uint16_t b)
{
    uint32_t product;
    (void)b;
    ASSUME(product <= 32767UL * a); /* a mantissa is within +-32767 */
    factors[made & 1] = a;
    products[made & 1] = product;
    made++;
    return product;
}
#define fix_mul_u16 open_product
#include "model/scale.c"

static uwide_t nearest(uwide_t product, uint8_t bits)
{
    return bits == 0 ? product : ((product >> (bits - 1)) + 1) >> 1;
}

void scale_apply_exact(void)
{
    scale_t scale;
    int32_t value;

    ASSUME(scale.shift <= MOST_scale_t_shift && scale.mantissa > -32768);
    const int32_t result = scale_apply(&scale, value);
    ASSERT(made == 2 && factors[0] == fix_abs_u32(value) >> 16 && factors[1] == (uint16_t)fix_abs_u32(value));
    const uwide_t product = ((uwide_t)products[0] << 16) + products[1];
    /* Uses two bits below the mantissa's 15 and cuts the rest: at most 3/4 of a unit from the exact product. */
    ASSERT(fix_abs_u32(result) == (uint32_t)nearest(product >> 14, (uint8_t)(scale.shift + 1)));
    ASSERT(result == 0 || (result < 0) == ((value < 0) != (scale.mantissa < 0)));
    END();
}

void scale_apply16_exact(void)
{
    scale_t scale;
    int16_t value;

    ASSUME(scale.shift <= MOST_scale_t_shift && scale.mantissa > -32768);
    const int32_t result = scale_apply16(&scale, value);
    ASSERT(fix_abs_u32(result) == (uint32_t)nearest((uwide_t)products[0] << 1, (uint8_t)(scale.shift + 1)));
    END();
}

void scale_grows(void)
{
    uwide_t less, more;
    uint8_t bits;

    ASSUME(less <= more && more < (1ULL << 48) && bits <= 32);
    ASSERT(nearest(less >> 14, bits) <= nearest(more >> 14, bits));
    ASSERT(nearest(less << 1, bits) <= nearest(more << 1, bits));
    END();
}
