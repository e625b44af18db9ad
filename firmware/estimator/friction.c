#include "estimator/friction.h"

#ifndef FRICTION_UNLEARNT

#include "core/fix.h"

enum {
    QUIET_MRAD_S = 60,     /* largest yaw rate at rest: 3 times the gyro's resolution, 4 sd of its noise */
    QUIET_MM_S2 = 115,     /* largest acceleration at rest: the same multiples for the accelerometer */
    QUIET_MEAN_MM_S2 = 20, /* largest mean at rest: 4 sd of the mean of FRICTION_REST_STEPS readings */
    FEIGNED_MM_S2 =
        FRICTION_BIAS_MM_S2 * 5 / 2, /* acceleration that an unknown bias, the speed from it, and noise feign */
    PER_MS_Q15 = 524                 /* learning rate: 16 / s */
};

#define MOST_MV_Q4 (FRICTION_MOST_MV * 16L)

static inline bool slow(int16_t speed_mm_s_q4)
{
    return fix_abs_u16(speed_mm_s_q4) <= FRICTION_SLOW_MM_S_Q4;
}

static bool quiet(const friction_input_t *input)
{
    return input->driven && input->have_gyro && slow(input->speed_mm_s_q4) &&
           fix_abs_u16(input->yaw_rate_mrad_s) <= QUIET_MRAD_S && fix_abs_u16(input->accel_mm_s2) <= QUIET_MM_S2;
}

/* True after FRICTION_REST_STEPS quiet steps whose mean acceleration is noise: a gentle start is not rest. */
static bool rests(friction_state_t *state, const friction_input_t *input)
{
    const bool is_quiet = quiet(input);
    uint16_t sum;

    if (is_quiet) {
        state->rest_sum_mm_s2 = fix_add16(state->rest_sum_mm_s2, input->accel_mm_s2);
        if (state->quiet_steps < FRICTION_REST_STEPS - 1) {
            state->quiet_steps++;
            return false;
        }
    }
    sum = fix_abs_u16(state->rest_sum_mm_s2);
    state->quiet_steps = 0;
    state->rest_sum_mm_s2 = 0;
    return is_quiet && sum <= QUIET_MEAN_MM_S2 * FRICTION_REST_STEPS;
}

/* The friction in force: 4 * (learnt friction - friction that a bias feigns), within 0..learnt friction. */
static int32_t in_force_mv_q4(const friction_config_t *config, const friction_state_t *state)
{
    const int32_t learnt_mv_q4 = (int32_t)state->learnt_mv_q4;
    const int32_t feigned_mv_q4 = (int32_t)(fix_mul_u16((uint16_t)config->mv_per_mm_s2_q10, FEIGNED_MM_S2) >> 6);
    const int32_t beyond_mv_q4 = 4 * (learnt_mv_q4 - feigned_mv_q4);

    if (beyond_mv_q4 <= 0)
        return 0;
    return beyond_mv_q4 < learnt_mv_q4 ? beyond_mv_q4 : learnt_mv_q4;
}

static void learn(const friction_config_t *config, friction_state_t *state, const friction_input_t *input)
{
    const int16_t share_q15 = (int16_t)fix_mul_u16(input->period_ms, PER_MS_Q15);
    const int32_t change_mv_q8 = fix_mul_q15(input->innovation_mm_s_q17, config->mv_per_mm_s2_q10);
    const int32_t change = fix_round_shift(change_mv_q8, 4);
    int32_t learnt = (int32_t)state->learnt_mv_q4;

    learnt -= fix_mul_q15(learnt - in_force_mv_q4(config, state), share_q15);
    learnt = input->speed_mm_s_q4 < 0 ? fix_sub32(learnt, change) : fix_add32(learnt, change);
    state->learnt_mv_q4 = (uint16_t)(learnt < 0 ? 0 : fix_clamp32(learnt, MOST_MV_Q4));
}

/* Counts how long the estimated speed has been slow, and the time since the last "rest as told" (friction.h). */
static void watch_speed(friction_state_t *state, const friction_input_t *input)
{
    if (!slow(input->speed_mm_s_q4)) {
        state->slow_ms = 0;
        if (state->trusted_ms <= FRICTION_TRUSTED_MS)
            state->trusted_ms = (state->trusted_ms + input->period_ms) & 511U;
        return;
    }
    if (state->slow_ms <= FRICTION_SLOW_MS)
        state->slow_ms = (state->slow_ms + input->period_ms) & 127U;
    if (state->slow_ms > FRICTION_SLOW_MS)
        state->trusted_ms = 0;
}

friction_belief_t friction_step(const friction_config_t *config, friction_state_t *state, const friction_input_t *input)
{
    watch_speed(state, input);
    if (rests(state, input)) {
        state->trusted_ms = 0;
        return FRICTION_REST;
    }
    if (!input->driven || state->motion != FRICTION_ROLLS || state->trusted_ms > FRICTION_TRUSTED_MS)
        return FRICTION_MODEL;
    if (!slow(input->speed_mm_s_q4))
        learn(config, state, input);
    return FRICTION_ACCELEROMETER;
}

void friction_take_motion(const friction_config_t *config, friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t yaw_rate_mrad_s)
{
    const uint16_t speed = fix_abs_u16(speed_mm_s_q4);
    const uint32_t turning =
        fix_mul_u16(fix_abs_u16(yaw_rate_mrad_s), (uint16_t)config->half_track_m_q14) >> 10; /* speed of a side */

    if (speed >= FRICTION_STILL_MM_S_Q4 && speed >= turning)
        state->motion = FRICTION_ROLLS;
    else
        state->motion = turning >= FRICTION_STILL_MM_S_Q4 ? FRICTION_TURNS : FRICTION_STILL;
}

int16_t friction_mv(const friction_config_t *config, const friction_state_t *state)
{
    return (int16_t)fix_trunc_shift(in_force_mv_q4(config, state), 4);
}

int16_t friction_takes_mv(const friction_config_t *config, const friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t surge_mv)
{
    const int16_t mv = friction_mv(config, state);

    if (state->motion == FRICTION_ROLLS)
        return speed_mm_s_q4 < 0 ? (int16_t)-mv : mv;
    return state->motion == FRICTION_TURNS ? 0 : fix_clamp16(surge_mv, mv);
}

#endif
