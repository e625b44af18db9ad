#include "sensors/random.h"

#include <math.h>

static const double TWO_PI = 6.283185307179586;

static uint64_t rotate_left(uint64_t x, int k)
{
    return (x << k) | (x >> (64 - k));
}

static uint64_t splitmix64(uint64_t *x)
{
    *x += 0x9e3779b97f4a7c15U;
    uint64_t z = *x;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31);
}

void random_start(random_t *random, uint64_t seed)
{
    *random = (random_t){0};
    for (int i = 0; i < 4; i++)
        random->word[i] = splitmix64(&seed);
}

static uint64_t next(random_t *random)
{
    uint64_t *s = random->word;
    const uint64_t result = rotate_left(s[1] * 5, 7) * 9;
    const uint64_t t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate_left(s[3], 45);
    return result;
}

double random_uniform(random_t *random)
{
    return (double)(next(random) >> 11) * 0x1p-53;
}

double random_normal(random_t *random)
{
    if (random->has_spare) {
        random->has_spare = 0;
        return random->spare;
    }
    const double radius = sqrt(-2 * log(1 - random_uniform(random)));
    const double angle = TWO_PI * random_uniform(random);
    random->spare = radius * sin(angle);
    random->has_spare = 1;
    return radius * cos(angle);
}
