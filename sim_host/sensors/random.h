/* random.h: xoshiro256** (Blackman & Vigna 2018), seeded by splitmix64. The same seed gives the same numbers
 * everywhere. */
#ifndef BRICKPILOT_SENSORS_RANDOM_H
#define BRICKPILOT_SENSORS_RANDOM_H

#include <stdint.h>

typedef struct {
    uint64_t word[4];
    double spare; /* second half of a Box-Muller pair */
    int has_spare;
} random_t;

/* Any seed; neighbouring seeds give unrelated streams. */
void random_start(random_t *random, uint64_t seed);

/* Uniform in [0, 1), 53 bits. */
double random_uniform(random_t *random);

/* Normal, mean 0, standard deviation 1 (Box-Muller). */
double random_normal(random_t *random);

#endif
