#include "control/pid.h"

#include "core/fix.h"

enum { PERIOD_MAX_MS = 20 };

/* mV/s Q10 times ms is mV Q16 times 0.064: that times the period in ms, times 2^14. */
static const uint16_t FACTOR_Q14[PERIOD_MAX_MS + 1] = {0,     1049,  2097,  3146,  4195,  5243,  6292,
                                                       7340,  8389,  9438,  10486, 11535, 12584, 13632,
                                                       14681, 15729, 16778, 17827, 18875, 19924, 20973};

/* The change of the integral over one step, mV Q16. */
static int32_t increment_mv_q16(const pid_config_t *config, const pid_input_t *input)
{
    const uint8_t period_ms = input->period_ms > PERIOD_MAX_MS ? PERIOD_MAX_MS : input->period_ms;
    const int32_t rate_mv_s_q10 = fix_mul(config->ki_mv_q10, input->error);
    /* By magnitude, so that rounding does not favour one direction. */
    const int32_t magnitude = (int32_t)(fix_mul_u32_q16(fix_abs_u32(rate_mv_s_q10), FACTOR_Q14[period_ms]) << 2);
    return rate_mv_s_q10 < 0 ? -magnitude : magnitude;
}

static void integrate(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, int8_t limited)
{
    if (config->ki_mv_q10 == 0 && state->integral_mv_q16 == 0)
        return;
    const int32_t change_mv_q16 = increment_mv_q16(config, input);
    const bool above = limited > 0 || input->saturated > 0;
    const bool below = limited < 0 || input->saturated < 0;
    if ((above && change_mv_q16 > 0) || (below && change_mv_q16 < 0)) {
        state->held_steps = fix_count_u16(state->held_steps);
        return;
    }
    state->integral_mv_q16 =
        fix_clamp32(fix_add32(state->integral_mv_q16, change_mv_q16), (int32_t)config->limit_mv << 16);
}

/* Feedforward, proportional and derivative part; fills the parts of `output`. */
static int32_t without_integral_mv(const pid_config_t *config, const pid_input_t *input, pid_output_t *output)
{
    const int32_t proportional_mv = fix_round_shift(fix_mul(config->kp_mv_q10, input->error), 10);
    const int32_t derivative_mv =
        config->kd_mv_q10 == 0 ? 0 : -fix_round_shift(fix_mul(config->kd_mv_q10, input->rate), 10);
    output->proportional_mv = fix_sat16(proportional_mv);
    output->derivative_mv = fix_sat16(derivative_mv);
    return proportional_mv + derivative_mv + input->feedforward_mv;
}

void pid_start(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, int16_t output_mv)
{
    pid_output_t parts;
    const int32_t integral_mv = output_mv - without_integral_mv(config, input, &parts);
    state->integral_mv_q16 = (int32_t)((uint32_t)fix_clamp32(integral_mv, config->limit_mv) << 16);
}

void pid_stop(pid_state_t *state)
{
    state->integral_mv_q16 = 0;
}

void pid_step(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, pid_output_t *output)
{
    const int32_t integral_mv = fix_round_shift(state->integral_mv_q16, 16);
    const int32_t wanted_mv = without_integral_mv(config, input, output) + integral_mv;
    const int32_t given_mv = fix_clamp32(wanted_mv, config->limit_mv);

    output->integral_mv = (int16_t)integral_mv;
    output->output_mv = (int16_t)given_mv;
    output->limited = (int8_t)((wanted_mv > given_mv) - (wanted_mv < given_mv));
    if (output->limited != 0)
        state->limited_steps = fix_count_u16(state->limited_steps);
    integrate(config, state, input, output->limited);
}
