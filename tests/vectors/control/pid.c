#include "control/pid.h"

#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 32 };

static void begin(pid_config_t *config, pid_state_t *state)
{
    config->kp_mv_q10 = draw_between(0, 32767);
    config->ki_mv_q10 = draw_between(0, 32767);
    config->kd_mv_q10 = draw_between(0, 32767);
    config->limit_mv = draw_between(0, 32000);
    state->integral_mv_q16 = 0;
}

void vectors_feed(void)
{
    static pid_config_t config;
    static pid_state_t state;
    static uint8_t left;
    pid_input_t input;
    pid_output_t output;

    if (left == 0) {
        left = RUN_STEPS;
        begin(&config, &state);
    }
    left--;
    input.error = draw_s16();
    input.rate = draw_s16();
    input.feedforward_mv = draw_rarely(1) ? draw_s16() : 0;
    input.saturated = (int8_t)draw_between(-1, 1);
    input.period_ms = (uint8_t)draw_between(1, draw_rarely(3) ? 255 : 20);
    if (draw_rarely(4))
        pid_start(&config, &state, &input, draw_s16());
    if (draw_rarely(6))
        pid_stop(&state, &output);
    else
        pid_step(&config, &state, &input, &output);
    hash_s32(state.integral_mv_q16);
    hash_pid_output(&output);
}
