/* speed.h: surge from the model's prediction, corrected by whatever sensors there are.
 *
 * The model, driven by the voltage applied, predicts; this stage compares and returns the correction that the caller
 * adds to the model's surge (body_correct_surge), so that both go on from the same speed.
 *
 *   accelerometer     surge' = specific force + sway * yaw rate; a share of the difference to the model's change of speed
 *   rotation sensors  an observer on the travel of the vehicle's middle: the travel by which the estimate lies behind the
 *                     counts moves both the travel (damping) and the speed
 *   at rest           the speed is 0, and the accelerometer's bias is learnt
 *   reference         overrides all
 *
 * Gains are per step of STEP_MS; a late step is corrected by the same amount, which delays and does not upset it.
 * Negate every input and the state, and the output is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_SPEED_H
#define BRICKPILOT_ESTIMATOR_SPEED_H

#include "core/signals.h"
#include "estimator/bias.h"

#define SPEED_BEHIND_LIMIT_UM_Q5 3200000L /* 100 mm: beyond it the wheels slip, and the observer forgets */

typedef struct {
    int16_t accel_gain_q15;      /* share of the accelerometer in a change of speed, 0..32767 = 1 */
    uint8_t slowest_weight_bits; /* the accelerometer's bias moves by at least 2^-this of the error per step at rest,
                                     0..12 */
    uint16_t count_travel_um_q2; /* travel of a wheel per count, mean of both, 1..65535: up to 16.4 mm */
    int16_t
        count_mismatch_q15; /* the left wheel's is longer, the right one's shorter, by this share, -32767..32767 = -1..1 */
    int16_t behind_to_travel_q15; /* share of the travel behind that is made up in a step, 0..32767 */
    int16_t behind_to_speed_q15;  /* change of speed [mm/s q17] per travel behind [um q5], in a step, 0..32767 */
    int16_t accel_filter_q15;     /* share of a new acceleration in the filtered one, 1..32767 */
} speed_config_t;

/* All zero to begin with, at rest. */
typedef struct {
    int32_t speed_mm_s_q17; /* signals_state_t has it rounded */
    int32_t accel_mm_s2_q8; /* the same */
    int32_t behind_um_q5;   /* travel by the counts minus travel estimated, +-100 mm */
    bias_t bias;            /* the accelerometer's, mm/s^2 q12, +-1 m/s^2 */
    uint16_t rotation_left; /* of the step before */
    uint16_t rotation_right;
    int16_t sway_mm_s_q4; /* of the step before */
    bool rotation_known;
} speed_state_t;

/* One step. Takes the sensors, the model's surge (now, a step after its last correction) and sway, heading_step()'s yaw rate and at_rest.
 * Sets speed, acceleration and both travels. Returns what the model's surge lacks, mm/s q17, +-16.4 m/s. */
int32_t speed_step(const speed_config_t *config, speed_state_t *state, signals_state_t *signals);

#endif
