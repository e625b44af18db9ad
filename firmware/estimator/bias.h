/* bias.h: a sensor's bias, learnt from samples at rest. The first sample sets the bias. Later samples are averaged into
 * it, each with less weight than the previous sample. Negate value and sample, and the result is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_BIAS_H
#define BRICKPILOT_ESTIMATOR_BIAS_H

#include <stdint.h>

/* All fields are 0 at the start. */
typedef struct {
    int32_t value;   /* in the samples' unit and format */
    uint16_t learnt; /* number of samples; saturates at 65535 */
} bias_t;

/* Takes a sample, within +-2^30. The sample gets at least the weight 2^-slowest_weight_bits, 0..16. The bias saturates
 * at +-limit, 0..2^30. */
void bias_learn(bias_t *bias, int32_t sample, uint8_t slowest_weight_bits, int32_t limit);

#endif
