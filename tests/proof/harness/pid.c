#include "contracts.h"
#include "control/pid.c"
#include "control/pid_start.c"

static const pid_config_t *any_config(const parameters_t *parameters)
{
    bool heading;
    ASSUME(settings_hold(parameters));
    return heading ? &parameters->config.step.heading_pid : &parameters->config.step.speed_pid;
}

void pid_safe(void)
{
    parameters_t parameters;
    const pid_config_t *const config = any_config(&parameters);
    pid_state_t state;
    pid_input_t input;
    pid_output_t output;

    ASSUME(pid_holds(&state));
    pid_step(config, &state, &input, &output);
    ASSERT(pid_holds(&state));
    ASSERT(UP_TO(config->limit_mv, output.output_mv));
    ASSERT(UP_TO((int32_t)config->limit_mv * 65536, state.integral_mv_q16) || output.limited != 0 ||
           input.saturated != 0);
    ASSERT(output.limited >= -1 && output.limited <= 1);
    END();
}

void pid_start_safe(void)
{
    parameters_t parameters;
    const pid_config_t *const config = any_config(&parameters);
    pid_state_t state;
    pid_input_t input;
    int16_t wanted_mv;

    pid_start(config, &state, &input, wanted_mv);
    ASSERT(pid_holds(&state) && UP_TO((int32_t)config->limit_mv * 65536, state.integral_mv_q16));
    END();
}

void pid_stop_clears(void)
{
    pid_state_t state;
    pid_output_t output;

    pid_stop(&state, &output);
    ASSERT(pid_holds(&state) && output.output_mv == 0 && state.integral_mv_q16 == 0);
    END();
}
