/* heading.h: heading and yaw rate from the gyro, less the bias found at rest.
 *
 * The bias is learnt from blocks of HEADING_BLOCK_STEPS samples in which nothing moves: both motors get 0 V, the model
 * has come to rest, the rotation sensors (if there are any) do not count, and the gyro's spread is small. The first
 * block sets the bias, the next ones are averaged in, the later the slower. A reference overrides the gyro.
 * The rotation sensors' own heading is not fused: a count is 2 degrees of heading, and an error of 1 % in half-track or
 * wheel radius turns more heading than the gyro's bias does after a rest.
 * What is known of the gyro beforehand, its bias and then its scale, is taken out first, to the nearest mrad/s; learnt
 * is what is left.
 * Negate all rates, the known bias and the initial heading, and the output is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_HEADING_H
#define BRICKPILOT_ESTIMATOR_HEADING_H

#include "core/signals.h"
#include "estimator/bias.h"

#define HEADING_BLOCK_STEPS (STEP_MS < 6 ? 64 : 16) /* 0.2 s, in a power of two of steps */
#define HEADING_BIAS_LIMIT_MRAD_S 127

typedef struct {
    uint16_t quiet_mrad_s;       /* largest difference of two samples in a block taken at rest, 1..32767 */
    uint16_t rest_speed_mm_s_q4; /* the model rests at or below this, 0..32767 */
    uint8_t slowest_weight_bits; /* a block counts at least 2^-this, 0..7 */
    uint16_t blind_ms;           /* so long may the model's yaw rate stand in for the gyro, 0..65000 */
    int16_t gyro_bias_mrad_s;    /* known: what the gyro says at rest, any */
    int16_t gyro_scale_q15;      /* known: what its rates lack beside, -32767..32767 = -1..1 of themselves */
} heading_config_t;

/* All zero to begin with, or with heading_bam32 set to where the robot points. */
typedef struct {
    bias_t bias; /* mrad/s q8, of blocks: beside the known one, +-127 mrad/s */
    uint32_t heading_bam32;
    int32_t block_sum_mrad_s;
    int16_t raw_rate_mrad_s; /* of the step before, with the bias that is left */
    int16_t block_least_mrad_s;
    int16_t block_most_mrad_s;
    uint16_t rotation_left; /* of the step before */
    uint16_t rotation_right;
    uint16_t blind_ms; /* since the last gyro sample or reference */
    uint8_t block_steps;
} heading_state_t;

/* One step of sensors.period_ms (1..20). Takes the sensors, `driven` and the model's surge; its yaw rate where there is no gyro.
 * Sets heading, yaw rate, at_rest, and valid: not blind for longer than blind_ms. The heading is the integral of the mean of two
 * samples: error below 2e-5 of the angle turned, and 2^-8 mrad/s of bias. */
void heading_step(const heading_config_t *config, heading_state_t *state, signals_state_t *signals);

#endif
