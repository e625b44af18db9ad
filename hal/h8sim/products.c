/* products.c: on the simulator, the products of fix_h8.h against the sum of shifted factors, which need none:
 * edges with edges, then pseudo-random pairs. The program's status is 1 where one differs. */
#include "core/fix.h"

enum { PAIRS = 5000 };

static uint32_t by_shifts(uint16_t a, uint16_t b)
{
    uint32_t sum = 0, shifted = a;
    for (; b != 0; b = (uint16_t)(b >> 1), shifted <<= 1)
        if ((b & 1U) != 0)
            sum += shifted;
    return sum;
}

static bool right(uint16_t a, uint16_t b)
{
    const int16_t x = (int16_t)a, y = (int16_t)b;
    const uint32_t magnitude = by_shifts(fix_abs_u16(x), fix_abs_u16(y));
    const int32_t product = (x < 0) != (y < 0) ? -(int32_t)magnitude : (int32_t)magnitude;
    return fix_mul_u16(a, b) == by_shifts(a, b) && fix_mul(x, y) == product;
}

int main(void)
{
    static const uint16_t edges[] = {0,   1,     2,      127,    128,    254,    255,    256,    257,   511,
                                     512, 32767, 32768U, 32769U, 65279U, 65280U, 65281U, 65534U, 65535U};
    enum { EDGES = sizeof edges / sizeof edges[0] };
    uint32_t random = 1;

    for (uint8_t i = 0; i < EDGES; i++)
        for (uint8_t j = 0; j < EDGES; j++)
            if (!right(edges[i], edges[j]))
                return 1;
    for (uint16_t i = 0; i < PAIRS; i++) {
        random ^= random << 13; /* xorshift32 */
        random ^= random >> 17;
        random ^= random << 5;
        if (!right((uint16_t)(random >> 16), (uint16_t)random))
            return 1;
    }
    return 0;
}
