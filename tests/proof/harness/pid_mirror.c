#include "mirror.h"
#define fix_mul odd_mul
#define fix_mul_q10 odd_gain_q10
#define fix_mul_q16 odd_share_q16
#include "control/pid.c"

/* If every input and the state are negated, every output and the new state are negated, bit for bit. */
void pid_mirror(void)
{
    parameters_t parameters;
    const pid_config_t *const config = &parameters.config.step.heading_pid;
    pid_state_t state, other;
    pid_input_t input, mirrored;
    pid_output_t output, opposite;

    ASSUME(settings_hold(&parameters) && pid_holds(&state));
    ASSUME(input.error >= -32767 && input.rate >= -32767 &&
           input.feedforward_mv >= -32767); /* -32768 has no mirror image */
    ASSUME(input.saturated >= -1 && input.saturated <= 1);
    other.integral_mv_q16 = -state.integral_mv_q16;
    mirrored.error = (int16_t)-input.error;
    mirrored.rate = (int16_t)-input.rate;
    mirrored.feedforward_mv = (int16_t)-input.feedforward_mv;
    mirrored.saturated = (int8_t)-input.saturated;
    mirrored.period_ms = input.period_ms;
    pid_step(config, &state, &input, &output);
    pid_step(config, &other, &mirrored, &opposite);
    ASSERT(other.integral_mv_q16 == -state.integral_mv_q16);
    ASSERT(opposite.output_mv == -output.output_mv && opposite.limited == -output.limited);
    ASSERT(opposite.proportional_mv == -output.proportional_mv && opposite.integral_mv == -output.integral_mv &&
           opposite.derivative_mv == -output.derivative_mv);
    END();
}
