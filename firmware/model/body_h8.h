/* body_h8.h: where body_coefficients_t and body_state_t have their fields on the RCX: for body_h8.S, and body.c beside it. */
#ifndef BRICKPILOT_MODEL_BODY_H8_H
#define BRICKPILOT_MODEL_BODY_H8_H

#define COEFFICIENTS_MOTOR_0 2
#define COEFFICIENTS_MOTOR_1 26
#define COEFFICIENTS_DRAG 50
#define COEFFICIENTS_SURGE_FROM_WHEEL 62
#define COEFFICIENTS_QUARTER_WHEEL_FROM_SURGE 66
#define COEFFICIENTS_YAW_RATE_FROM_WHEEL 70

#define STATE_MOTOR_0 0
#define STATE_SPEED_0 4
#define STATE_MOTOR_1 8
#define STATE_SURGE 24

#ifndef H8_ASSEMBLY

#include "core/h8_layout.h"
#include "model/body.h"

H8_LAYOUT(body_coefficients_t, motor[0], COEFFICIENTS_MOTOR_0);
H8_LAYOUT(body_coefficients_t, motor[1], COEFFICIENTS_MOTOR_1);
H8_LAYOUT(body_coefficients_t, drag, COEFFICIENTS_DRAG);
H8_LAYOUT(body_coefficients_t, surge_from_wheel, COEFFICIENTS_SURGE_FROM_WHEEL);
H8_LAYOUT(body_coefficients_t, quarter_wheel_from_surge, COEFFICIENTS_QUARTER_WHEEL_FROM_SURGE);
H8_LAYOUT(body_coefficients_t, yaw_rate_from_wheel, COEFFICIENTS_YAW_RATE_FROM_WHEEL);
H8_LAYOUT(body_state_t, motor[0], STATE_MOTOR_0);
H8_LAYOUT(body_state_t, motor[0].speed_mrad_s_q13, STATE_SPEED_0);
H8_LAYOUT(body_state_t, motor[1], STATE_MOTOR_1);
H8_LAYOUT(body_state_t, motor[1].speed_mrad_s_q13, STATE_MOTOR_1 + STATE_SPEED_0);
H8_LAYOUT(body_state_t, motion.surge_mm_s_q17, STATE_SURGE);
H8_LAYOUT(body_state_t, motion.yaw_rate_mrad_s_q12, STATE_MOTOR_1 + STATE_SURGE);

#endif

#endif
