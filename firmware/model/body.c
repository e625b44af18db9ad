#include "core/fix.h"
#include "model/body.h"

/* On the RCX, h8/body.S has the profile `coupled`. In a build without `paper`, h8/body.S replaces all of this file. */
#ifdef FIX_IN_ASSEMBLY
void body_h8_predict(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv, int16_t right_mv);
void body_h8_correct_surge(const body_coefficients_t *coefficients, body_state_t *state, int32_t change_mm_s_q17);
#define predict_coupled body_h8_predict
#define correct_coupled body_h8_correct_surge
#endif

#if !defined(FIX_IN_ASSEMBLY) || !defined(BODY_WITHOUT_PAPER)

#include "core/turns.h"
#include "model/body_parts.h"

enum { THRUST_TO_SPEED_BITS = 7 };

static inline int32_t clamp_speed(int32_t speed_mm_s_q17)
{
    return fix_clamp_q16(speed_mm_s_q17, BODY_SPEED_LIMIT_MM_S_Q17 / 65536);
}
/* Square of a speed, in (mm/s)^2 q2. */
static int32_t square(int32_t speed_mm_s_q17)
{
    const uint16_t speed_q1 = (uint16_t)(fix_abs_u32(speed_mm_s_q17) >> 16);
    return (int32_t)fix_mul_u16(speed_q1, speed_q1);
}

/* Drag by eq. 5, on one axis. */
static int32_t drag(const body_coefficients_t *coefficients, int32_t speed_mm_s_q17)
{
    const int32_t loss = scale_apply(&coefficients->drag, square(speed_mm_s_q17));
    return speed_mm_s_q17 < 0 ? loss : -loss;
}

#ifndef FIX_IN_ASSEMBLY
static void predict_coupled(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv,
                            int16_t right_mv)
{
    motor_state_t *const mean = &state->motor[0];
    motor_state_t *const difference = &state->motor[1];

    motor_step(&coefficients->motor[0], mean, (int16_t)(left_mv + right_mv),
               drag(coefficients, state->motion.surge_mm_s_q17));
    motor_step(&coefficients->motor[1], difference, (int16_t)(left_mv - right_mv), 0);
    state->motion.surge_mm_s_q17 = scale_apply(&coefficients->surge_from_wheel, mean->speed_mrad_s_q13);
    state->motion.yaw_rate_mrad_s_q12 = scale_apply(&coefficients->yaw_rate_from_wheel, difference->speed_mrad_s_q13);
}

static void correct_coupled(const body_coefficients_t *coefficients, body_state_t *state, int32_t change_mm_s_q17)
{
    motor_state_t *const mean = &state->motor[0];
    const int32_t quarter = scale_apply(&coefficients->quarter_wheel_from_surge, change_mm_s_q17);
    for (uint8_t i = 0; i < 4; i++)
        mean->speed_mrad_s_q13 = fix_add32(mean->speed_mrad_s_q13, quarter);
    mean->speed_mrad_s_q13 = fix_clamp_q16(mean->speed_mrad_s_q13, MOTOR_SPEED_LIMIT_MRAD_S_Q13_HIGH);
    state->motion.surge_mm_s_q17 = scale_apply(&coefficients->surge_from_wheel, mean->speed_mrad_s_q13);
}
#endif

#ifndef BODY_WITHOUT_PAPER
/* Change of speed that one wheel's thrust causes in this step, in mm/s q24. */
static int32_t thrust(const body_coefficients_t *coefficients, uint8_t side, motor_state_t *wheel, int16_t voltage_mv)
{
    const int32_t before = wheel->speed_mrad_s_q13;
    motor_step(&coefficients->motor[side], wheel, voltage_mv, 0);
    return scale_apply16(&coefficients->thrust_from_voltage, voltage_mv) -
           scale_apply(&coefficients->thrust_from_wheel, middle(before, wheel->speed_mrad_s_q13));
}

static bool moves(int32_t surge_mm_s_q17, int32_t sway_mm_s_q17)
{
    const uint32_t surge = fix_abs_u32(surge_mm_s_q17), sway = fix_abs_u32(sway_mm_s_q17);
    if (surge >= BODY_REST_SPEED_MM_S_Q17 || sway >= BODY_REST_SPEED_MM_S_Q17)
        return true;
    return fix_mul_u16((uint16_t)surge, (uint16_t)surge) + fix_mul_u16((uint16_t)sway, (uint16_t)sway) >=
           fix_mul_u16((uint16_t)BODY_REST_SPEED_MM_S_Q17, (uint16_t)BODY_REST_SPEED_MM_S_Q17);
}

/* Direction of thrust by eq. 6, 7 and 9, in the room's frame: along the velocity. If the vehicle moves backward, along
 * the mirror image of the velocity that points forward. */
static uint16_t thrust_bam16(const body_state_t *state, uint16_t heading_bam16)
{
    if (!moves(state->motion.surge_mm_s_q17, state->motion.sway_mm_s_q17))
        return heading_bam16;
    const uint16_t course_bam16 = trig_atan2_bam16(state->velocity_y_mm_s_q17, state->velocity_x_mm_s_q17);
    const int16_t sideslip_bam16 = fix_angle_diff_bam16(course_bam16, heading_bam16);
    return fix_abs_u16(sideslip_bam16) <= TURN_QUARTER ? course_bam16
                                                       : (uint16_t)(2U * heading_bam16 + 32768U - course_bam16);
}

static void push(body_state_t *state, direction_t along, direction_t ahead, int32_t thrust_mm_s_q24, int32_t drag_surge,
                 int32_t drag_sway)
{
    state->velocity_x_mm_s_q17 =
        clamp_speed(state->velocity_x_mm_s_q17 + part(thrust_mm_s_q24, along.cos_q15, THRUST_TO_SPEED_BITS) +
                    part(drag_surge, ahead.cos_q15, 0) - part(drag_sway, ahead.sin_q15, 0));
    state->velocity_y_mm_s_q17 =
        clamp_speed(state->velocity_y_mm_s_q17 + part(thrust_mm_s_q24, along.sin_q15, THRUST_TO_SPEED_BITS) +
                    part(drag_surge, ahead.sin_q15, 0) + part(drag_sway, ahead.cos_q15, 0));
}

static void predict_paper(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv,
                          int16_t right_mv)
{
    const int32_t left = thrust(coefficients, 0, &state->motor[0], left_mv);
    const int32_t right = thrust(coefficients, 1, &state->motor[1], right_mv);
    const int32_t gain = scale_apply(&coefficients->yaw_rate_from_thrust, left - right);
    const int32_t yaw_rate_before = state->motion.yaw_rate_mrad_s_q12;

    const direction_t before = direction_of(rounded_heading_bam16(state));
    state->motion.yaw_rate_mrad_s_q12 =
        fix_clamp_q16(fix_add32(yaw_rate_before, gain), BODY_YAW_RATE_LIMIT_MRAD_S_Q12 / 65536);
    const uint16_t middle_bam16 = turn(coefficients, state, yaw_rate_before);
    push(state, direction_of(thrust_bam16(state, middle_bam16)), before, left + right,
         drag(coefficients, state->motion.surge_mm_s_q17), drag(coefficients, state->motion.sway_mm_s_q17));

    const int32_t x = state->velocity_x_mm_s_q17;
    const int32_t y = state->velocity_y_mm_s_q17;
    const direction_t ahead = direction_of(rounded_heading_bam16(state));
    state->motion.surge_mm_s_q17 = clamp_speed(part(x, ahead.cos_q15, 0) + part(y, ahead.sin_q15, 0));
    state->motion.sway_mm_s_q17 = clamp_speed(part(y, ahead.cos_q15, 0) - part(x, ahead.sin_q15, 0));
}
#endif

void body_predict(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv, int16_t right_mv)
{
    left_mv = fix_clamp16(left_mv, MOTOR_VOLTAGE_LIMIT_MV);
    right_mv = fix_clamp16(right_mv, MOTOR_VOLTAGE_LIMIT_MV);
#ifndef BODY_WITHOUT_PAPER
    if (BODY_IS_PAPER(coefficients)) {
        predict_paper(coefficients, state, left_mv, right_mv);
        return;
    }
#endif
    predict_coupled(coefficients, state, left_mv, right_mv);
}

void body_correct_surge(const body_coefficients_t *coefficients, body_state_t *state, int32_t change_mm_s_q17)
{
    if (BODY_IS_PAPER(coefficients)) {
        const direction_t ahead = direction_of(rounded_heading_bam16(state));
        state->velocity_x_mm_s_q17 = clamp_speed(state->velocity_x_mm_s_q17 + part(change_mm_s_q17, ahead.cos_q15, 0));
        state->velocity_y_mm_s_q17 = clamp_speed(state->velocity_y_mm_s_q17 + part(change_mm_s_q17, ahead.sin_q15, 0));
        state->motion.surge_mm_s_q17 = clamp_speed(state->motion.surge_mm_s_q17 + change_mm_s_q17);
        return;
    }
    correct_coupled(coefficients, state, change_mm_s_q17);
}
#endif
