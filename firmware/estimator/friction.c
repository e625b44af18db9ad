#include "estimator/friction.h"

#ifndef FRICTION_UNLEARNT

#include "core/fix.h"

enum {
    QUIET_MRAD_S = 60,                           /* three resolutions of the gyro, four sd of its noise */
    QUIET_MM_S2 = 115,                           /* the same of the accelerometer */
    QUIET_MEAN_MM_S2 = 20,                       /* four sd of a mean of FRICTION_REST_STEPS */
    FEIGNED_MM_S2 = FRICTION_BIAS_MM_S2 * 5 / 2, /* the bias, its speed by the end over the time constant, and noise */
    PER_MS_Q15 = 524                             /* 16 / s */
};

#define MOST_MV_Q8 (FRICTION_MOST_MV * 256L)

static inline bool slow(const friction_state_t *state)
{
    return fix_abs_u16(state->speed_mm_s_q4) <= FRICTION_SLOW_MM_S_Q4;
}

static bool quiet(const friction_state_t *state, const friction_input_t *input)
{
    return input->driven && input->have_gyro && slow(state) && fix_abs_u16(input->yaw_rate_mrad_s) <= QUIET_MRAD_S &&
           fix_abs_u16(input->accel_mm_s2) <= QUIET_MM_S2;
}

/* True at the end of enough quiet steps whose mean acceleration is none: a robot that starts gently is no rest. */
static bool rests(friction_state_t *state, const friction_input_t *input)
{
    const bool is_quiet = quiet(state, input);
    uint16_t sum;

    if (is_quiet) {
        state->rest_sum_mm_s2 = fix_add16(state->rest_sum_mm_s2, input->accel_mm_s2);
        if (++state->quiet_steps < FRICTION_REST_STEPS)
            return false;
    }
    sum = fix_abs_u16(state->rest_sum_mm_s2);
    state->quiet_steps = 0;
    state->rest_sum_mm_s2 = 0;
    return is_quiet && sum <= QUIET_MEAN_MM_S2 * FRICTION_REST_STEPS;
}

/* Of what is learnt, four times as much is in force as it is beyond what a bias feigns, up to the whole. */
static int32_t in_force_mv_q8(const friction_config_t *config, int32_t learnt_mv_q8)
{
    const int32_t feigned_mv_q8 = (int32_t)(fix_mul_u16((uint16_t)config->mv_per_mm_s2_q10, FEIGNED_MM_S2) >> 2);
    const int32_t beyond_mv_q8 = 4 * (learnt_mv_q8 - feigned_mv_q8);

    if (beyond_mv_q8 <= 0)
        return 0;
    return beyond_mv_q8 < learnt_mv_q8 ? beyond_mv_q8 : learnt_mv_q8;
}

static void learn(const friction_config_t *config, friction_state_t *state, const friction_input_t *input)
{
    const int16_t share_q15 = (int16_t)fix_mul_u16(input->period_ms, PER_MS_Q15);
    const int32_t change = fix_mul_q15(input->innovation_mm_s_q17, config->mv_per_mm_s2_q10);
    int32_t learnt = state->learnt_mv_q8;

    learnt -= fix_mul_q15(learnt - state->in_force_mv_q8, share_q15);
    learnt = state->speed_mm_s_q4 < 0 ? fix_sub32(learnt, change) : fix_add32(learnt, change);
    state->learnt_mv_q8 = learnt < 0 ? 0 : fix_clamp32(learnt, MOST_MV_Q8);
    state->in_force_mv_q8 = in_force_mv_q8(config, state->learnt_mv_q8);
}

/* Counts the time since the last rest as told. */
static void watch_speed(friction_state_t *state, uint8_t period_ms)
{
    if (slow(state)) {
        state->slow_ms = fix_add_u16(state->slow_ms, period_ms);
        if (state->slow_ms > FRICTION_SLOW_MS)
            state->trusted_ms = 0;
    } else {
        state->slow_ms = 0;
        state->trusted_ms = fix_add_u16(state->trusted_ms, period_ms);
    }
}

friction_belief_t friction_step(const friction_config_t *config, friction_state_t *state, const friction_input_t *input)
{
    watch_speed(state, input->period_ms);
    if (rests(state, input)) {
        state->trusted_ms = 0;
        return FRICTION_REST;
    }
    if (!input->driven || state->motion != FRICTION_ROLLS || state->trusted_ms > FRICTION_TRUSTED_MS)
        return FRICTION_MODEL;
    if (!slow(state))
        learn(config, state, input);
    return FRICTION_ACCELEROMETER;
}

void friction_take_motion(const friction_config_t *config, friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t yaw_rate_mrad_s)
{
    const uint16_t speed = fix_abs_u16(speed_mm_s_q4);
    const uint32_t turning =
        fix_mul_u16(fix_abs_u16(yaw_rate_mrad_s), (uint16_t)config->half_track_m_q14) >> 10; /* of a side */

    state->speed_mm_s_q4 = speed_mm_s_q4;
    if (speed >= FRICTION_STILL_MM_S_Q4 && speed >= turning)
        state->motion = FRICTION_ROLLS;
    else
        state->motion = turning >= FRICTION_STILL_MM_S_Q4 ? FRICTION_TURNS : FRICTION_STILL;
}

int16_t friction_mv(const friction_state_t *state)
{
    return (int16_t)fix_trunc_shift(state->in_force_mv_q8, 8);
}

int16_t friction_takes_mv(const friction_state_t *state, int16_t surge_mv)
{
    const int16_t mv = friction_mv(state);

    switch (state->motion) {
    case FRICTION_ROLLS:
        return state->speed_mm_s_q4 < 0 ? (int16_t)-mv : mv;
    case FRICTION_TURNS:
        return 0;
    default:
        return fix_clamp16(surge_mv, mv);
    }
}

#endif
