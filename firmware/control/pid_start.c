#include "control/pid.h"
#include "core/fix.h"

void pid_start(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, int16_t output_mv)
{
    const int32_t proportional_mv = fix_round_shift(fix_mul(config->kp_mv_q10, input->error), 10);
    const int32_t derivative_mv = -fix_round_shift(fix_mul(config->kd_mv_q10, input->rate), 10);
    const int32_t integral_mv = output_mv - proportional_mv - derivative_mv - input->feedforward_mv;

    state->integral_mv_q16 = (int32_t)((uint32_t)fix_clamp32(integral_mv, config->limit_mv) << 16);
}
