/* Tries every input there is, in the host's code, for properties that CBMC does not prove in a minute (roots, products)
 * or was given no time for (duties; sines took 47 s). Prints a line; exits 1 if the property does not hold. The second
 * argument is the half: 0 or 1. */
#include <stdio.h>
#include <string.h>

#include "core/fix.c"
#include "core/trig.c"
#include "mixer/mixer.c"
#include "wire/frame.c"

/* Loops over 2^32 values count in 32 bits, 65536 values at a time, so that the compiler makes them of vector instructions. */

/* Returns 1 where fix_sqrt_u32() is not the largest root whose square is at most the value. A root of 16 bits has a square of 32. */
static uint32_t root(uint32_t value)
{
    const uint32_t found = fix_sqrt_u32(value), square = found * found;
    return (uint32_t)(square > value) | (uint32_t)(value - square > 2 * found);
}

static unsigned long roots(uint32_t first, uint32_t last)
{
    unsigned long wrong = 0;
    for (uint32_t high = first; high < last; high++) {
        uint32_t wrong_here = 0;
        for (uint32_t low = 0; low < 65536; low++)
            wrong_here += root(high << 16 | low);
        wrong += wrong_here;
    }
    return wrong;
}

static unsigned long products(uint32_t first, uint32_t last)
{
    unsigned long wrong = 0;
    for (uint32_t a = first; a < last; a++)
        for (uint32_t b = 0; b < 65536; b++) {
            wrong += (uint64_t)fix_mul_u16((uint16_t)a, (uint16_t)b) != (uint64_t)a * b;
            wrong += (int64_t)fix_mul((int16_t)a, (int16_t)b) != (int64_t)(int16_t)a * (int16_t)b;
        }
    return wrong;
}

/* The duty for a voltage above the battery's is at most max_duty. A smaller voltage gives no larger duty, since a
 * quotient grows with its dividend. take_supply() keeps the battery within 1000 (battery_floor_mv) and 32000 mV. */
static unsigned long duties(uint32_t first, uint32_t last)
{
    unsigned long wrong = 0;
    const mixer_state_t zero = {.battery_mv = 0};
    for (uint32_t battery = first < 1000 ? 1000 : first; battery < last && battery <= VOLTAGE_MAX_MV; battery++)
        for (int32_t most = 1; most <= FIX_INT16_MAX; most++) {
            const mixer_config_t config = {.battery_floor_mv = (uint16_t)battery, .max_duty_q15 = (int16_t)most};
            const supply_t supply = take_supply(&config, &zero);
            wrong += duty_q15(&supply, FIX_INT16_MAX) > most;
        }
    return wrong;
}

/* fix_div_1000() against the formula in fix.h, with a product of 64 bits. */
static unsigned long thousandths(uint32_t first, uint32_t last)
{
    unsigned long wrong = 0;
    for (uint32_t high = first; high < last; high++) {
        uint32_t wrong_here = 0;
        for (uint32_t low = 0; low < 65536; low++) {
            const int32_t value = (int32_t)(high << 16 | low);
            const uint32_t magnitude = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;
            const uint32_t product = (uint32_t)((uint64_t)magnitude * 16777 >> 16); /* below 2^30 */
            const uint32_t part = (product + 128) >> 8;
            const int32_t most = part > 32767 ? 32767 : (int32_t)part;

            wrong_here += fix_div_1000(value) != (value < 0 ? -most : most);
        }
        wrong += wrong_here;
    }
    return wrong;
}

static unsigned long sines(uint32_t first, uint32_t last)
{
    unsigned long wrong = 0;
    for (uint32_t angle = first; angle < last; angle++) {
        const uint16_t mirrored = (uint16_t)(0U - angle);
        wrong += trig_sin_q15(mirrored) != -trig_sin_q15((uint16_t)angle);
        wrong += trig_cos_q15(mirrored) != trig_cos_q15((uint16_t)angle);
        wrong += trig_sin_q15((uint16_t)(angle + TURN_HALF)) != -trig_sin_q15((uint16_t)angle);
    }
    return wrong;
}

/* COBS copies bytes and only tests whether they are 0. So all patterns of zeros, in all sizes, cover all contents. */
static unsigned long cobs(uint32_t first, uint32_t last)
{
    unsigned long wrong = 0;
    for (uint32_t zeros = first; zeros < last; zeros++)
        for (uint8_t size = HEAD + TAIL; size <= RAW_MAX; size++) {
            uint8_t raw[RAW_MAX], got[RAW_MAX], bytes[FRAME_SIZE_MAX];

            for (uint8_t i = 0; i < size; i++)
                raw[i] = zeros >> i & 1U ? 0 : (uint8_t)(255 - i);
            const uint8_t coded = cobs_encode(raw, size, bytes);
            wrong += coded != size + 1 || memchr(bytes, 0, coded) != NULL;
            wrong += cobs_decode(bytes, coded, got) != size || memcmp(got, raw, size) != 0;
        }
    return wrong;
}

int main(int count, char **words)
{
    static const struct {
        const char *name;
        unsigned long (*wrong)(uint32_t first, uint32_t last);
        uint32_t end; /* end of the inputs; the work is split in their middle */
    } ALL[] = {{"roots", roots, 65536}, {"products", products, 65536},       {"duties", duties, 32001},
               {"sines", sines, 65536}, {"thousandths", thousandths, 65536}, {"cobs", cobs, 8192}};
    const uint32_t half = count > 2 ? (uint32_t)(words[2][0] - '0') : 0;

    for (unsigned i = 0; count > 1 && i < sizeof ALL / sizeof ALL[0]; i++)
        if (strcmp(words[1], ALL[i].name) == 0) {
            const uint32_t middle = ALL[i].end / 2;
            const unsigned long wrong = ALL[i].wrong(half ? middle : 0, half ? ALL[i].end : middle);
            printf("%s, half %u: %lu wrong\n", words[1], (unsigned)half, wrong);
            return wrong != 0;
        }
    return 2;
}
