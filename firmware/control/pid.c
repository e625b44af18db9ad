#include "control/pid.h"

#include "core/fix.h"

#ifndef FIX_IN_ASSEMBLY
enum { PERIOD_MAX_MS = 20 };

/* mV/s Q10 times ms is mV Q16 times 0.064: that times the period, times 2^14: 1048.576 a millisecond, to the nearest. By bytes,
 * which the RCX multiplies at once. */
static uint16_t factor_q14(uint8_t period_ms)
{
    if (period_ms > PERIOD_MAX_MS)
        period_ms = PERIOD_MAX_MS;
    return (uint16_t)((uint16_t)(period_ms * 131U) << 3) + (uint16_t)((uint16_t)(period_ms * 160U + 128U) >> 8);
}

static void integrate(const pid_config_t *config, pid_state_t *state, const pid_terms_t *terms)
{
    const int32_t rate_mv_s_q10 = fix_mul(config->ki_mv_q10, terms->error);
    const int32_t change_mv_q16 = (int32_t)((uint32_t)fix_share_q16(rate_mv_s_q10, factor_q14(terms->period_ms)) << 2);
    const int8_t direction = change_mv_q16 < 0 ? -1 : 1;

    if (change_mv_q16 != 0 && (direction == terms->limited || direction == terms->saturated))
        state->held_steps = fix_count_u16(state->held_steps);
    else
        state->integral_mv_q16 = fix_clamp_q16(fix_add_to(change_mv_q16, &state->integral_mv_q16), config->limit_mv);
}

void pid_stop(pid_state_t *state, pid_terms_t *terms)
{
    state->integral_mv_q16 = 0;
    terms->limited = 0;
    terms->output_mv = 0;
    terms->proportional_mv = 0;
    terms->integral_mv = 0;
    terms->derivative_mv = 0;
}

void pid_step(const pid_config_t *config, pid_state_t *state, pid_terms_t *terms)
{
    const int32_t proportional_mv = fix_gain_q10(config->kp_mv_q10, terms->error);
    const int32_t derivative_mv = -fix_gain_q10(config->kd_mv_q10, terms->rate);
    int16_t asked_mv;

    terms->proportional_mv = fix_sat16(proportional_mv);
    terms->derivative_mv = fix_sat16(derivative_mv);
    terms->integral_mv = (int16_t)fix_round_shift(state->integral_mv_q16, 16);
    asked_mv = fix_sat16(proportional_mv + derivative_mv + terms->integral_mv + terms->feedforward_mv);
    terms->output_mv = fix_clamp16(asked_mv, config->limit_mv);
    terms->limited = fix_excess(asked_mv, terms->output_mv, &state->limited_steps);
    integrate(config, state, terms);
}
#endif
