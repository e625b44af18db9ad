#include "estimator/speed.h"

#include "core/fix.h"

enum {
    Q17_PER_UM_S_Q8_Q15 = 16777,     /* 131.072 / 256: converts um/s q8 to mm/s q17 */
    PER_1000_Q24 = 16777,            /* 1/1000: applied as q15, then shifted by 9 bits */
    MM_S2_Q8_PER_Q17_MS_Q14 = 32000, /* 256 * 1000 / 131072: converts mm/s q17 per ms to mm/s^2 q8 */
    SPEED_LIMIT_MM_S_Q1 = 16380,
    JUMP_LIMIT_MM_S_Q1 = 8192,
    MOST_TRAVEL_UM_Q_11 = 16384, /* um / 2^11: 2^30 um q5 */
    MOST_COUNTS = 4096,
    KNOWN_BIAS = 64 /* samples after which the bias is known: their mean has an eighth of the noise, 4 mm/s^2 */
};

#define BIAS_LIMIT_MM_S2_Q12 4096000L
#define UNREAD_LIMIT_UM_Q5 536870912L /* 16.8 m: 2^29, so that the residual fits into 32 bits */

static inline int16_t to_q4(int32_t speed_mm_s_q17)
{
    return fix_round_shift16(speed_mm_s_q17, 13);
}

static inline int16_t sway_mm_s_q4(const signals_predicted_t *predicted)
{
    return predicted->motion.sway_mm_s_q17 == 0 ? 0 : to_q4(predicted->motion.sway_mm_s_q17);
}

/* The Coriolis acceleration of eq. 2: sway times yaw rate. */
static int16_t coriolis_mm_s2(const signals_predicted_t *predicted, int16_t yaw_rate_mrad_s)
{
    const int32_t product_q4 = fix_mul(sway_mm_s_q4(predicted), yaw_rate_mrad_s);
    return product_q4 == 0 ? 0 : fix_round_shift16(fix_mul_q15(product_q4, PER_1000_Q24), 13);
}

/* The accelerometer's reading without its bias, plus the Coriolis term. */
static int16_t forward_mm_s2(const speed_state_t *state, const signals_sensors_t *sensors,
                             const signals_predicted_t *predicted, int16_t yaw_rate_mrad_s)
{
    const int16_t specific_force_mm_s2 = sensors->accel_surge_mm_s2;
    const int16_t bias_mm_s2 = fix_round_shift16(state->bias.value, 12);
    if (!SIGNALS_SWAY)
        return fix_sub16(specific_force_mm_s2, bias_mm_s2);
    return fix_sat16((int32_t)specific_force_mm_s2 - bias_mm_s2 + coriolis_mm_s2(predicted, yaw_rate_mrad_s));
}

#ifndef FRICTION_UNLEARNT
/* True if only the accelerometer measures the speed, and its bias is known. */
static bool learns_friction(const speed_config_t *config, const speed_state_t *state, const signals_sensors_t *sensors)
{
    return config->friction.mv_per_mm_s2_q10 != 0 && state->bias.learnt >= KNOWN_BIAS && !state->rotation_known &&
           !SIGNALS_HAVE(sensors, SENSOR_ROTATION | SENSOR_REFERENCE);
}
#endif

/* The accelerometer's correction of the predicted speed, in mm/s q17: eq. 2, with the specific force as X - D_u. */
static int32_t accel_correction(const speed_config_t *config, speed_state_t *state, const signals_sensors_t *sensors,
                                const signals_predicted_t *predicted, int16_t yaw_rate_mrad_s)
{
    const int16_t accel_mm_s2 = forward_mm_s2(state, sensors, predicted, yaw_rate_mrad_s);
    const int32_t change_um_s_q8 = fix_mul32_u8(fix_to_q8(accel_mm_s2), sensors->period_ms);
    const int32_t measured_change = fix_mul_q15(change_um_s_q8, Q17_PER_UM_S_Q8_Q15);
    const int32_t predicted_change = fix_sub32(predicted->motion.surge_mm_s_q17, state->speed_mm_s_q17);
    const int32_t difference = fix_sub32(measured_change, predicted_change);

#ifndef FRICTION_UNLEARNT
    if (learns_friction(config, state, sensors)) {
        friction_input_t input; /* set field by field: on the RCX an initialiser calls memcpy */
        friction_belief_t belief;

        input.innovation_mm_s_q17 = fix_sub32(0, difference);
        input.speed_mm_s_q4 = state->speed_mm_s_q4;
        input.accel_mm_s2 = accel_mm_s2;
        input.yaw_rate_mrad_s = yaw_rate_mrad_s;
        input.period_ms = sensors->period_ms;
        input.driven = predicted->driven;
        input.have_gyro = SIGNALS_HAVE(sensors, SENSOR_GYRO);
        belief = friction_step(&config->friction, &state->friction, &input);
        if (belief == FRICTION_REST)
            return fix_sub32(0, predicted->motion.surge_mm_s_q17);
        if (belief == FRICTION_ACCELEROMETER)
            return difference;
    }
#endif
    return fix_mul_q15(difference, config->accel_gain_q15);
}

static int32_t travel_of_counts_um_q5(const speed_config_t *config, int16_t counts)
{
    const int16_t limited = fix_clamp16(counts, MOST_COUNTS);
    const int32_t travel = (int32_t)fix_mul_u16((uint16_t)(fix_abs_u16(limited) << 2), config->count_travel_um_q2);
    return limited < 0 ? -travel : travel;
}

/* Travel of the vehicle's middle since the previous step, by the rotation sensors. */
static int32_t counted_travel_um_q5(const speed_config_t *config, speed_state_t *state,
                                    const signals_sensors_t *sensors)
{
    const int16_t left = (int16_t)(uint16_t)(sensors->rotation_left - state->rotation_left);
    const int16_t right = (int16_t)(uint16_t)(sensors->rotation_right - state->rotation_right);
    const bool known = state->rotation_known;
    state->rotation_left = sensors->rotation_left;
    state->rotation_right = sensors->rotation_right;
    state->rotation_known = true;
    if (!known)
        return 0;
    const int32_t mean = travel_of_counts_um_q5(config, fix_add16(left, right));
    const int32_t turned = travel_of_counts_um_q5(config, fix_sub16(left, right));
    return fix_clamp_q16(mean + fix_mul_q15(turned, config->count_mismatch_q15), MOST_TRAVEL_UM_Q_11);
}

/* The rotation sensors' correction of the predicted speed, in mm/s q17. Corrects the travel, too. A step without a
 * reading gets no correction, but its estimated travel is kept, since the next reading includes the counts of that
 * step. */
static int32_t rotation_correction(const speed_config_t *config, speed_state_t *state, const signals_sensors_t *sensors,
                                   signals_estimate_t *estimate)
{
    int32_t residual = state->residual_um_q5 - estimate->travel_um_q5, correction;
    if (!SIGNALS_HAVE(sensors, SENSOR_ROTATION)) {
        if (state->rotation_known)
            state->residual_um_q5 = fix_clamp32(residual, UNREAD_LIMIT_UM_Q5);
        return 0;
    }
    residual += counted_travel_um_q5(config, state, sensors);
    correction = fix_mul_q15(residual, config->travel_gain_q15);
    estimate->travel_um_q5 += correction;
    state->residual_um_q5 = fix_clamp32(residual - correction, SPEED_RESIDUAL_LIMIT_UM_Q5);
    return fix_mul_q15(state->residual_um_q5, config->speed_gain_q15);
}

/* The filtered acceleration after the speed has changed by `jump_mm_s_q17` in this step. */
static int16_t filter_accel(const speed_config_t *config, speed_state_t *state, int32_t jump_mm_s_q17,
                            uint8_t period_ms)
{
    const int32_t jump = fix_clamp_q16(jump_mm_s_q17, JUMP_LIMIT_MM_S_Q1);
    const int32_t accel_mm_s2_q9 =
        fix_mul_q15(fix_mul_q15(jump, fix_reciprocal_q15(period_ms)), MM_S2_Q8_PER_Q17_MS_Q14);
    const int32_t change = 2 * accel_mm_s2_q9 - state->accel_mm_s2_q8;
    state->accel_mm_s2_q8 += fix_mul_q15(change, config->accel_filter_q15);
    return fix_round_shift16(state->accel_mm_s2_q8, 8);
}

/* Travel at the mean of two speeds. */
static inline int32_t travel_um_q5(int16_t before_mm_s_q4, int16_t after_mm_s_q4, uint8_t period_ms)
{
    return fix_mul32_u8(fix_add(before_mm_s_q4, after_mm_s_q4), period_ms);
}

/* The speed from prediction and sensors, in mm/s q17. Sets the forward travel. */
static int32_t observe(const speed_config_t *config, speed_state_t *state, const signals_sensors_t *sensors,
                       const signals_predicted_t *predicted, signals_estimate_t *estimate)
{
    int32_t observed = predicted->motion.surge_mm_s_q17;

    estimate->travel_um_q5 = travel_um_q5(state->speed_mm_s_q4, to_q4(observed), sensors->period_ms);
    if (SIGNALS_HAVE(sensors, SENSOR_ACCELEROMETER)) {
        if (estimate->at_rest)
            bias_learn(&state->bias, fix_mul(sensors->accel_surge_mm_s2, 4096), config->slowest_weight_bits,
                       BIAS_LIMIT_MM_S2_Q12);
        else
            observed =
                fix_add32(observed, accel_correction(config, state, sensors, predicted, estimate->yaw_rate_mrad_s));
    }
    if (SENSOR_POSSIBLE(SENSOR_ROTATION))
        observed = fix_add32(observed, rotation_correction(config, state, sensors, estimate));
    if (estimate->at_rest) {
        observed = 0;
        estimate->travel_um_q5 = 0;
        if (SIGNALS_HAVE(sensors, SENSOR_ROTATION))
            state->residual_um_q5 = 0;
    }
    if (SIGNALS_HAVE(sensors, SENSOR_REFERENCE))
        observed = fix_mul(sensors->reference_speed_mm_s_q4, 8192);
    return fix_clamp_q16(observed, SPEED_LIMIT_MM_S_Q1);
}

int32_t speed_step(const speed_config_t *config, speed_state_t *state, const signals_sensors_t *sensors,
                   const signals_predicted_t *predicted, signals_estimate_t *estimate)
{
    const int32_t observed = observe(config, state, sensors, predicted, estimate);

    estimate->accel_mm_s2 = filter_accel(config, state, observed - state->speed_mm_s_q17, sensors->period_ms);
    state->speed_mm_s_q17 = observed;
    estimate->speed_mm_s_q4 = to_q4(observed);
    if (SIGNALS_HAVE(sensors, SENSOR_REFERENCE))
        estimate->travel_um_q5 = travel_um_q5(state->speed_mm_s_q4, estimate->speed_mm_s_q4, sensors->period_ms);
    state->speed_mm_s_q4 = estimate->speed_mm_s_q4;
    if (SIGNALS_SWAY) {
        const int16_t now_mm_s_q4 = sway_mm_s_q4(predicted);
        estimate->sway_travel_um_q5 = travel_um_q5(state->sway_mm_s_q4, now_mm_s_q4, sensors->period_ms);
        state->sway_mm_s_q4 = now_mm_s_q4;
    }
#ifndef FRICTION_UNLEARNT
    friction_take_motion(&config->friction, &state->friction, estimate->speed_mm_s_q4, estimate->yaw_rate_mrad_s);
#endif
    return fix_sub32(state->speed_mm_s_q17, predicted->motion.surge_mm_s_q17);
}
