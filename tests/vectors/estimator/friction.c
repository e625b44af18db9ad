#include "estimator/friction.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 128 };

static void draw_config(friction_config_t *config)
{
    config->mv_per_mm_s2_q10 = draw_between(0, 32767);
    config->half_track_m_q14 = draw_between(0, 32767);
}

static void begin(friction_state_t *state)
{
    bytes_clear(state, sizeof *state);
    if (draw_rarely(1))
        return;
    state->learnt_mv_q4 = draw_up_to(FRICTION_MOST_MV * 16U);
    state->slow_ms = draw_up_to(FRICTION_SLOW_MS + 20);
    state->trusted_ms = draw_up_to(FRICTION_TRUSTED_MS + 20);
}

/* A third of the runs is of a slow and quiet robot, a third of one that rolls, and the rest of anything. */
static void draw_step(friction_input_t *input, uint8_t kind)
{
    input->innovation_mm_s_q17 = kind == 0 ? draw_s32() : draw_within(131072L);
    input->accel_mm_s2 = kind == 1 ? draw_between(-60, 60) : draw_s16();
    input->yaw_rate_mrad_s = kind == 0 ? draw_s16() : draw_between(-62, 62);
    input->period_ms = draw_rarely(2) ? (uint8_t)draw_between(1, 20) : STEP_MS;
    input->driven = !draw_rarely(7);
    input->have_gyro = !draw_rarely(7);
    input->speed_mm_s_q4 = kind == 0 ? draw_s16() : kind == 1 ? draw_between(-645, 645) : draw_between(600, 9000);
}

static void hash(const friction_state_t *state)
{
    hash_u16(state->learnt_mv_q4);
    hash_s16(state->rest_sum_mm_s2);
    hash_u16((uint16_t)state->slow_ms);
    hash_u16((uint16_t)state->trusted_ms);
    hash_u8((uint8_t)state->quiet_steps);
    hash_u8((uint8_t)state->motion);
}

void vectors_feed(void)
{
    static friction_config_t config;
    static friction_state_t state;
    static friction_input_t input;
    static uint8_t left, kind;

    if (left == 0) {
        left = RUN_STEPS;
        kind = (uint8_t)draw_up_to(2);
        draw_config(&config);
        if (!draw_rarely(1))
            bytes_copy_flash(&config, &PARAMS.step.speed.friction, sizeof config);
        begin(&state);
    }
    left--;
    draw_step(&input, kind);
    hash_u8((uint8_t)friction_step(&config, &state, &input));
    friction_take_motion(&config, &state, input.speed_mm_s_q4, input.yaw_rate_mrad_s);
    hash(&state);
    hash_s16(friction_mv(&config, &state));
    hash_s16(friction_takes_mv(&config, &state, input.speed_mm_s_q4, draw_s16()));
}
