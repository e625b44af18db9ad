/* heading.h: heading and yaw rate from the gyro, corrected for its bias, which is learnt at rest.
 *
 * The bias is learnt from blocks of HEADING_BLOCK_STEPS samples in which nothing moves: both motors get 0 V, the model
 * has come to rest, the rotation sensors (if there are any) do not count, and the gyro's samples differ little. A step
 * without a sample makes the block longer and does not end it. The first block sets the bias. Later blocks are averaged
 * into it, each with less weight than the previous block. A reference overrides the gyro.
 * The rotation sensors' own heading is not used: one count is 2 degrees of heading, and an error of 1 % in half-track
 * or wheel radius turns the heading further than the gyro's bias does after a rest.
 * The configuration may hold a known bias and a known scale error. Both are corrected first, to the nearest mrad/s;
 * then the remaining bias is learnt. A reading at the end of the gyro's range is too small, and the heading gets an
 * error: such steps are counted. Negate all rates, the known bias and the initial heading, and the output
 * is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_HEADING_H
#define BRICKPILOT_ESTIMATOR_HEADING_H

#include "core/signals.h"
#include "estimator/bias.h"

#define HEADING_BLOCK_STEPS (STEP_MS < 6 ? 64 : 16) /* steps in a block: a power of two, about 0.2 s */
#define HEADING_BIAS_LIMIT_MRAD_S 127

typedef struct {
    uint16_t quiet_mrad_s;       /* largest difference of two samples in a block at rest, 1..32767 */
    uint16_t rest_speed_mm_s_q4; /* the model is at rest at or below this speed, 0..32767 */
    uint8_t slowest_weight_bits; /* least weight of a block in the bias: 2^-slowest_weight_bits, 0..7 */
    uint16_t blind_ms;           /* longest time for which the model's yaw rate may replace the gyro's, 0..65000 */
    uint16_t gyro_full_mrad_s;   /* a reading of this size or more is at the end of the gyro's range, 1..32767 */
    int16_t gyro_bias_mrad_s;    /* known bias: the gyro's reading at rest; any value is allowed */
    int16_t gyro_scale_q15;      /* known scale error: true rate = rate * (1 + this), -32767..32767 = -1..1 */
} heading_config_t;

/* All fields are 0 at the start; heading_bam32 may be the robot's heading instead. */
typedef struct {
    bias_t bias; /* learnt in addition to the known bias, mrad/s q8: +-127 mrad/s */
    uint32_t heading_bam32;
    int32_t block_sum_mrad_s;
    int16_t raw_rate_mrad_s; /* rate of the previous step, not yet corrected for the learnt bias */
    int16_t block_least_mrad_s;
    int16_t block_most_mrad_s;
    uint16_t rotation_left; /* counts in the previous step */
    uint16_t rotation_right;
    uint16_t blind_ms;   /* time since the last gyro sample or reference; saturates at 65535 */
    uint16_t full_steps; /* steps without a reference, with the gyro at the end of its range; saturates at 65535 */
    uint8_t block_steps;
    bool at_rest; /* true from the end of the first quiet block until something moves */
} heading_state_t;

/* One step of sensors->period_ms. Sets heading_bam16, yaw_rate_mrad_s, at_rest, valid and bias_unknown of `estimate`.
 * valid: false after more than blind_ms with neither gyro nor reference. bias_unknown: always false with a reference,
 * which needs no bias. The heading is integrated with the mean of two samples. Its error is below 2e-5 of the angle
 * turned plus a drift of 2^-8 mrad/s. */
void heading_step(const heading_config_t *config, heading_state_t *state, const signals_sensors_t *sensors,
                  const signals_predicted_t *predicted, signals_estimate_t *estimate);

#endif
