/* q16.c: Q16.16 arithmetic of libfixmath's kind, written for this comparison. As in libfixmath without 64 bits, a product is made of four of
 * 16 x 16 bits, and a quotient by shifts and subtractions. The product of 16 x 16 bits is the firmware's own, which is the fastest that
 * these chips have. Overflow is not looked for: libfixmath does so unless FIXMATH_NO_OVERFLOW is set.
 */
#include "arc_tangent.h"
#include "core/fix.h"

num num_mul(num a, num b)
{
    const uint32_t of_a = a < 0 ? 0U - (uint32_t)a : (uint32_t)a, of_b = b < 0 ? 0U - (uint32_t)b : (uint32_t)b;
    const uint16_t a_high = (uint16_t)(of_a >> 16), a_low = (uint16_t)of_a;
    const uint16_t b_high = (uint16_t)(of_b >> 16), b_low = (uint16_t)of_b;
    uint32_t product = (fix_mul_u16(a_low, b_low) + 0x8000U) >> 16;

    product += fix_mul_u16(a_high, b_low);
    product += fix_mul_u16(a_low, b_high);
    product += (uint32_t)(uint16_t)fix_mul_u16(a_high, b_high) << 16;
    return (a ^ b) < 0 ? -(num)product : (num)product;
}

num num_div(num a, num b)
{
    uint32_t rest = a < 0 ? 0U - (uint32_t)a : (uint32_t)a, divisor = b < 0 ? 0U - (uint32_t)b : (uint32_t)b;
    uint32_t quotient = 0, bit = 0x10000UL;

    if (divisor == 0)
        return a < 0 ? -FIX_INT32_MAX : FIX_INT32_MAX;
    for (; divisor < rest && (divisor & 0x80000000UL) == 0; divisor <<= 1)
        bit <<= 1;
    for (; bit != 0 && rest != 0; bit >>= 1) {
        if (rest >= divisor) {
            quotient |= bit;
            rest -= divisor;
        }
        if ((rest & 0x80000000UL) != 0)
            divisor >>= 1;
        else
            rest <<= 1;
    }
    if (rest >= divisor)
        quotient++;
    return (a ^ b) < 0 ? -(num)quotient : (num)quotient;
}

/* Bit by bit, of the value shifted up to 31 or 32 bits: 16 bits of the root. */
num num_sqrt(num value)
{
    uint32_t rest = (uint32_t)value, root = 0;
    uint8_t up = 8;

    if (rest == 0)
        return 0;
    for (; (rest & 0xC0000000UL) == 0; rest <<= 2)
        up--;
    for (uint32_t bit = 0x40000000UL; bit != 0; bit >>= 2) {
        const uint32_t trial = root + bit;

        root >>= 1;
        if (rest >= trial) {
            rest -= trial;
            root += bit;
        }
    }
    for (; (up & 0x80U) == 0 && up > 0; up--)
        root <<= 1;
    for (; up != 0; up++)
        root >>= 1;
    return (num)root;
}
