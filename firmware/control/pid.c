#include "control/pid.h"

#include "core/bytes.h"
#include "core/fix.h"

enum { PERIOD_MAX_MS = 20 };

/* Returns the factor 0.064 * period in Q14 (1048.576 * period, at most 1.5 too large): it converts a rate in mV/s Q10
 * into the change in mV Q16 over the period. Products are of two bytes: the RCX multiplies bytes in one instruction. */
static uint16_t factor_q14(uint8_t period_ms)
{
    if (period_ms > PERIOD_MAX_MS)
        period_ms = PERIOD_MAX_MS;
    return (uint16_t)((uint16_t)(period_ms * 131U) << 3) + (uint16_t)((uint16_t)(period_ms * 160U + 128U) >> 8);
}

static void integrate(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, int8_t limited)
{
    const int32_t rate_mv_s_q10 = fix_mul(config->ki_mv_q10, input->error);
    const int32_t change_mv_q16 = (int32_t)((uint32_t)fix_mul_q16(rate_mv_s_q10, factor_q14(input->period_ms)) << 2);
    const int8_t direction = change_mv_q16 < 0 ? -1 : 1;

    if (change_mv_q16 == 0 || (direction != limited && direction != input->saturated))
        state->integral_mv_q16 = fix_clamp_q16(fix_add32(state->integral_mv_q16, change_mv_q16), config->limit_mv);
}

void pid_stop(pid_state_t *state, pid_output_t *output)
{
    state->integral_mv_q16 = 0;
    bytes_clear(output, sizeof *output);
}

void pid_step(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, pid_output_t *output)
{
    const int32_t proportional_mv = fix_mul_q10(config->kp_mv_q10, input->error);
    const int32_t damping_mv = fix_mul_q10(config->kd_mv_q10, input->rate);
    int16_t asked_mv;

    output->proportional_mv = fix_sat16(proportional_mv);
    output->derivative_mv = (int16_t)-fix_sat16(damping_mv);
    output->integral_mv = (int16_t)fix_round_shift(state->integral_mv_q16, 16);
    asked_mv = fix_sat16(proportional_mv - damping_mv + fix_add(output->integral_mv, input->feedforward_mv));
    output->output_mv = fix_clamp16(asked_mv, config->limit_mv);
    output->limited = fix_compare16(asked_mv, output->output_mv);
    integrate(config, state, input, output->limited);
}
