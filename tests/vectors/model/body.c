#include "model/body.h"

#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 32 };

#define CURRENT_LIMIT_UA_Q7 1068800000L /* 8.35 A: both wheels' sum is told */

static void begin(const body_coefficients_t *coefficients, body_state_t *state)
{
    for (uint8_t i = 0; i < 2; i++) {
        state->motor[i].current_ua_q7 = draw_within(CURRENT_LIMIT_UA_Q7);
        state->motor[i].speed_mrad_s_q13 = draw_within(MOTOR_SPEED_LIMIT_MRAD_S_Q13);
    }
    state->velocity_x_mm_s_q17 = draw_within(BODY_SPEED_LIMIT_MM_S_Q17);
    state->velocity_y_mm_s_q17 = draw_within(BODY_SPEED_LIMIT_MM_S_Q17);
    state->motion.surge_mm_s_q17 = draw_within(BODY_SPEED_LIMIT_MM_S_Q17);
    state->motion.sway_mm_s_q17 = draw_within(BODY_SPEED_LIMIT_MM_S_Q17);
    state->motion.yaw_rate_mrad_s_q12 = draw_within(BODY_YAW_RATE_LIMIT_MRAD_S_Q12);
    if (!BODY_IS_PAPER(coefficients)) { /* the wheels tell: see body.h */
        state->motion.surge_mm_s_q17 = scale_apply(&coefficients->surge_from_wheel, state->motor[0].speed_mrad_s_q13);
        state->motion.yaw_rate_mrad_s_q12 =
            scale_apply(&coefficients->yaw_rate_from_wheel, state->motor[1].speed_mrad_s_q13);
    }
    state->heading_bam32 = (uint32_t)draw_s32();
    state->x_um = draw_s32();
    state->y_um = draw_s32();
    state->x_rest_um_q12 = draw_between(-4095, 4095);
    state->y_rest_um_q12 = draw_between(-4095, 4095);
}

void vectors_feed(void)
{
    static body_state_t state;
    static uint8_t left;
    const body_coefficients_t *const coefficients = PARAMS.step.model;
    const int16_t left_mv = draw_s16(), right_mv = draw_s16();
    body_wheels_t wheels;

    if (left == 0) {
        left = RUN_STEPS;
        begin(coefficients, &state);
    }
    left--;
    body_step(coefficients, &state, left_mv, right_mv);
    hash_body_state(&state);
    body_wheels(coefficients, &state, &wheels);
    hash_s32(wheels.left_current_ua_q7);
    hash_s32(wheels.right_current_ua_q7);
    hash_s32(wheels.left_mrad_s_q13);
    hash_s32(wheels.right_mrad_s_q13);
    hash_u16(body_heading_bam16(&state));
    if (draw_rarely(1)) {
        body_correct_surge(coefficients, &state, draw_within(BODY_SPEED_LIMIT_MM_S_Q17));
        hash_body_state(&state);
    }
}
