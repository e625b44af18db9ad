/* random.h: random numbers by xoshiro256** (Blackman & Vigna 2018), seeded by splitmix64. The same seed gives the same
 * numbers on every machine. */
#ifndef BRICKPILOT_SENSORS_RANDOM_H
#define BRICKPILOT_SENSORS_RANDOM_H

#include <stdint.h>

typedef struct {
    uint64_t word[4];
    double spare; /* the second number of a Box-Muller pair */
    int has_spare;
} random_t;

/* Starts from any seed. Neighbouring seeds give unrelated streams. */
void random_start(random_t *random, uint64_t seed);

/* Returns a number uniform in [0, 1), with 53 bits. */
double random_uniform(random_t *random);

/* Returns a normal number with mean 0 and standard deviation 1 (Box-Muller). */
double random_normal(random_t *random);

#endif
