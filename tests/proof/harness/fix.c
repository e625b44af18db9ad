/* Compares every function of fix.h with 64-bit arithmetic. A product of 32 by 16 bits is made of two of 16 by 16 bits,
 * which fix_mul_u16() makes exactly (one widening multiplication of C). Here these two are any numbers within their
 * ranges: the result must be right for all. */
#include "contracts.h"
#include "core/fix.h"

static uint32_t open_product(uint16_t a, uint16_t b);
#define fix_mul_u16 open_product
#include "core/fix.c"
#undef fix_mul_u16

typedef long long wide_t;

static uint16_t factors[2], with;
static uint32_t products[2];
static uint8_t made;

static uint32_t open_product(uint16_t a, uint16_t b)
{
    uint32_t product;
    ASSUME(product <= 65535UL * (uint32_t)a);
    factors[made & 1] = a;
    with = b;
    products[made & 1] = product;
    made++;
    return product;
}

static wide_t saturated(wide_t value, wide_t most)
{
    return value > most ? most : value < -most ? -most : value;
}

static wide_t magnitude(wide_t value)
{
    return value < 0 ? -value : value;
}

/* value / 2^bits to the nearest, halves away from zero. */
static wide_t rounded(wide_t value, uint8_t bits)
{
    const wide_t whole = (magnitude(value) + ((wide_t)1 << (bits - 1))) >> bits;
    return value < 0 ? -whole : whole;
}

void fix_sums(void)
{
    int32_t a, b, most;
    int16_t c, d, least;
    uint16_t e, f;

    ASSERT(fix_add32(a, b) == saturated((wide_t)a + b, 2147483647L));
    ASSERT(fix_sub32(a, b) == saturated((wide_t)a - b, 2147483647L));
    ASSERT(fix_add16(c, d) == saturated((wide_t)c + d, 32767));
    ASSERT(fix_sub16(c, d) == saturated((wide_t)c - d, 32767));
    ASSERT(fix_add(c, d) == (wide_t)c + d);
    ASSERT(fix_sat16(a) == saturated(a, 32767));
    ASSUME(most >= 0 && least >= 0);
    ASSERT(fix_clamp32(a, most) == saturated(a, most));
    ASSERT(fix_clamp16(c, least) == saturated(c, least));
    ASSERT(fix_clamp_q16(a, least) == saturated(a, (wide_t)least * 65536));
    ASSERT(fix_abs_u16(c) == magnitude(c));
    ASSERT(fix_abs_u32(a) == magnitude(a));
    ASSERT(fix_add_u16(e, f) == ((wide_t)e + f > 65535 ? 65535 : (wide_t)e + f));
    ASSERT(fix_increment_u16(e) == (e == 65535U ? 65535 : (wide_t)e + 1));
    ASSERT(fix_compare16(c, d) == (c > d) - (c < d));
    ASSERT(fix_to_q8(c) == (wide_t)c * 256);
    END();
}

void fix_shifts(void)
{
    int32_t value;
    uint32_t angle;
    uint8_t bits, less;
    uint16_t count;
    uint8_t most;

    ASSUME(bits >= 1 && bits <= 30);
    ASSERT(fix_round_shift(value, bits) == rounded(value, bits));
    ASSERT(fix_round_shift16(value, bits) == saturated(rounded(value, bits), 32767));
    ASSUME(less <= 31);
    ASSERT(fix_trunc_shift(value, less) == (value < 0 ? -(magnitude(value) >> less) : magnitude(value) >> less) ||
           (value == -2147483647L - 1 && less == 0));
    ASSERT(fix_round_bam16(angle) ==
           (uint16_t)rounded(angle < 0x80000000UL ? (wide_t)angle : (wide_t)angle - 0x100000000LL, 16));
    const uint8_t length = fix_bit_length(count, most);
    ASSERT(length <= most && length <= 16 && ((wide_t)count >> length == 0 || length == most));
    ASSERT(length == 0 || (wide_t)count >> (length - 1) != 0);
    END();
}

void fix_products(void)
{
    int16_t a, b;
    uint8_t c;

    (void)fix_mul(a, b); /* no overflow; exhaustive.c compares all products */
    ASSUME(c >= 1);
    ASSERT(fix_reciprocal_q15(c) == (c == 1 ? 32767 : (32768L + c / 2) / c));
    END();
}

/* gain * value, for any product. */
void fix_gains(void)
{
    int32_t product; /* any product that fix_mul() gives */

    ASSUME(magnitude(product) <= 1073741824L);
    ASSERT(fix_round_shift(product, 10) == rounded(product, 10));
    ASSERT(magnitude(fix_round_shift(product, 10)) <= 1048576L);
    END();
}

/* The exact product of `whole` and the newest factor: whole = high * 65536 + low, in this order of the calls. */
static wide_t product_of(uint32_t whole)
{
    ASSERT(made == 2 && factors[0] == (uint16_t)(whole >> 16) && factors[1] == (uint16_t)whole);
    return (wide_t)products[0] * 65536 + products[1];
}

void fix_mul_q15_exact(void)
{
    int32_t value;
    int16_t factor;
    const int32_t share = fix_mul_q15(value, factor);
    const wide_t whole = saturated(product_of(magnitude(value)) >> 15, 2147483647L);

    ASSERT(with == magnitude(factor));
    ASSUME(products[0] <= 32768UL * factors[0] && products[1] <= 32768UL * factors[1]); /* |factor| <= 32768 */
    ASSERT(share == ((value < 0) != (factor < 0) ? -whole : whole));
    END();
}

/* The bound of open_share_q15() for |factor| <= 32767: the product (fix_mul_q15_exact()) is at most 32767 |value|. */
void fix_mul_q15_bounds(void)
{
    uint32_t whole;
    wide_t product;

    ASSUME(product >= 0 && product <= ((wide_t)whole << 15) - whole);
    ASSERT(product >> 15 <= whole - (whole >> 15));
    END();
}

void fix_mul_q16_exact(void)
{
    int32_t value;
    uint16_t factor;
    const int32_t share = fix_mul_q16(value, factor);
    const wide_t whole = product_of(magnitude(value)) >> 16;

    ASSERT(with == factor);
    ASSERT(share == (value < 0 ? -whole : whole));
    END();
}

void fix_mul_u32_exact(void)
{
    uint32_t a;
    uint16_t b;
    const uint32_t share = fix_mul_u32_q16(a, b);

    ASSERT(share == product_of(a) >> 16);
    END();
}

void fix_pairs(void)
{
    fix_vector_t of, with_;
    uint16_t root;
    int32_t value;

    ASSUME(pair_holds(&of) && pair_holds(&with_));
    (void)fix_dot(&of, &with_); /* no overflow */
    (void)fix_project(&of, &with_);
    ASSUME(value >= 0 && root <= 32768U);
    made = 0;
    const int16_t compared = fix_compare_square(value, root);
    ASSUME(products[0] <= 1073741824UL);
    ASSERT((compared < 0) == (value < (wide_t)products[0]) && (compared > 0) == (value > (wide_t)products[0]));
    END();
}

void fix_div_1000_bounds(void)
{
    int32_t value;
    const wide_t part = fix_div_1000(value);

    ASSERT(part >= -32767 && part <= 32767);
    END();
}
