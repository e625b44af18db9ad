/* speed.h: surge from the model's prediction, corrected by the sensors that have a value.
 *
 * The model predicts from the voltages applied. This stage compares the prediction with the sensors and returns the
 * correction. The caller adds it to the model's surge (body_correct_surge), so that model and estimator agree.
 *
 *   accelerometer     surge' = specific force + sway * yaw rate. A share of the difference between this change of speed
 *                     and the predicted one corrects the speed; soon after a rest, all of it (friction.h).
 *   rotation sensors  an alpha-beta filter of the travel of the vehicle's middle. The residual, counted travel minus
 *                     estimated travel, corrects both the travel (which damps) and the speed.
 *   at rest           the speed is 0, and the accelerometer's bias is learnt
 *   reference         overrides all other sensors
 *
 * Gains are per step of STEP_MS. A late step gets the same correction as a step in time: the correction acts later, but
 * nothing becomes unstable. Negate every input and the state, and the output is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_SPEED_H
#define BRICKPILOT_ESTIMATOR_SPEED_H

#include "core/signals.h"
#include "estimator/bias.h"
#include "estimator/friction.h"

#define SPEED_RESIDUAL_LIMIT_UM_Q5 3200000L /* 100 mm: a larger residual means slip, and is cut to this size */

typedef struct {
    int16_t accel_gain_q15;      /* weight of the accelerometer in a change of speed, 0..32767 = 1 */
    uint8_t slowest_weight_bits; /* at rest the bias changes by at least 2^-this of its error per step, 0..12 */
    uint16_t count_travel_um_q2; /* travel per count, mean of both wheels, 1..65535: up to 16.4 mm */
    int16_t count_mismatch_q15;  /* fraction by which the left travel per count is larger, the right smaller: -1..1 */
    int16_t travel_gain_q15;     /* alpha: fraction of the residual that corrects the travel in a step, 0..32767 */
    int16_t speed_gain_q15;      /* beta: change of speed [mm/s q17] per residual [um q5], in a step, 0..32767 */
    int16_t accel_filter_q15;    /* weight of a new acceleration in the filtered acceleration, 1..32767 */
    friction_config_t friction;
} speed_config_t;

/* All fields are 0 at the start: the robot is at rest. */
typedef struct {
    int32_t speed_mm_s_q17; /* speed and acceleration; signals_estimate_t has the rounded values */
    int32_t accel_mm_s2_q8;
    int32_t residual_um_q5; /* counted minus estimated travel, +-100 mm; +-16.8 m until the next reading */
    bias_t bias;            /* the accelerometer's bias, mm/s^2 q12, +-1 m/s^2 */
    uint16_t rotation_left; /* counts in the previous step */
    uint16_t rotation_right;
    int16_t speed_mm_s_q4; /* speeds in the previous step */
    int16_t sway_mm_s_q4;
    bool rotation_known;
#ifndef FRICTION_UNLEARNT
    friction_state_t friction;
#endif
} speed_state_t;

/* One step of sensors->period_ms. Reads yaw_rate_mrad_s and at_rest of `estimate`, which heading_step() has set. Sets
 * speed, acceleration and both travels of `estimate`. Returns the correction of the model's surge, mm/s q17, +-16.4
 * m/s. */
int32_t speed_step(const speed_config_t *config, speed_state_t *state, const signals_sensors_t *sensors,
                   const signals_predicted_t *predicted, signals_estimate_t *estimate);

#endif
