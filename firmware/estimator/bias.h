/* bias.h: what a sensor says at rest, learnt from samples taken there: the first one sets it, the next ones are averaged in, the later
 * the slower. Negate value and sample, and the result is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_BIAS_H
#define BRICKPILOT_ESTIMATOR_BIAS_H

#include <stdint.h>

/* All zero to begin with. */
typedef struct {
    int32_t value;   /* in the samples' unit and format */
    uint16_t learnt; /* samples; stays at 65535 */
} bias_t;

/* A sample, within +-2^30, counts at least 2^-slowest_weight_bits, 0..16. The value saturates at +-limit, 0..2^30. */
void bias_learn(bias_t *bias, int32_t sample, uint8_t slowest_weight_bits, int32_t limit);

#endif
