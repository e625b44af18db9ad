#include "model/body_parts.h"

static void move_axis(int32_t *whole_um, int16_t *rest_um_q12, int32_t travel_um_q12)
{
    const int32_t sum = travel_um_q12 + *rest_um_q12;
    const uint32_t magnitude = fix_abs_u32(sum);
    const int32_t whole = (int32_t)(magnitude >> 12);
    const int16_t rest = (int16_t)(magnitude & 0xfffU);
    *whole_um = fix_add32(*whole_um, sum < 0 ? -whole : whole);
    *rest_um_q12 = sum < 0 ? (int16_t)-rest : rest;
}

static void move(body_state_t *state, int32_t x_um_q12, int32_t y_um_q12)
{
    move_axis(&state->x_um, &state->x_rest_um_q12, x_um_q12);
    move_axis(&state->y_um, &state->y_rest_um_q12, y_um_q12);
}

static int32_t mean_travel_um_q12(const body_coefficients_t *coefficients, int32_t before_mm_s_q17,
                                  int32_t after_mm_s_q17)
{
    return scale_apply(&coefficients->travel_from_speed, middle(before_mm_s_q17, after_mm_s_q17));
}

void body_step(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv, int16_t right_mv)
{
    const int32_t surge = state->motion.surge_mm_s_q17, yaw_rate = state->motion.yaw_rate_mrad_s_q12;
    const int32_t x = state->velocity_x_mm_s_q17, y = state->velocity_y_mm_s_q17;

    body_predict(coefficients, state, left_mv, right_mv);
    if (BODY_IS_PAPER(coefficients)) {
        move(state, mean_travel_um_q12(coefficients, x, state->velocity_x_mm_s_q17),
             mean_travel_um_q12(coefficients, y, state->velocity_y_mm_s_q17));
    } else {
        const direction_t along = direction_of(turn(coefficients, state, yaw_rate));
        const int32_t travel_um_q12 = mean_travel_um_q12(coefficients, surge, state->motion.surge_mm_s_q17);
        move(state, part(travel_um_q12, along.cos_q15, 0), part(travel_um_q12, along.sin_q15, 0));
    }
}

void body_wheels(const body_coefficients_t *coefficients, const body_state_t *state, body_wheels_t *wheels)
{
    const motor_state_t *const first = &state->motor[0];
    const motor_state_t *const second = &state->motor[1];
    const bool paper = BODY_IS_PAPER(coefficients);
    (void)coefficients;
    wheels->left_current_ua_q7 = paper ? first->current_ua_q7 : first->current_ua_q7 + second->current_ua_q7;
    wheels->right_current_ua_q7 = paper ? second->current_ua_q7 : first->current_ua_q7 - second->current_ua_q7;
    wheels->left_mrad_s_q13 = paper ? first->speed_mrad_s_q13 : first->speed_mrad_s_q13 + second->speed_mrad_s_q13;
    wheels->right_mrad_s_q13 = paper ? second->speed_mrad_s_q13 : first->speed_mrad_s_q13 - second->speed_mrad_s_q13;
}

uint16_t body_heading_bam16(const body_state_t *state)
{
    return rounded_heading_bam16(state);
}
