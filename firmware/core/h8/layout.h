/* layout.h: offsets, in bytes, that the RCX's compiler gives the fields of all structs that assembly reads. This is the
 * only list of these offsets: assembly includes it, and firmware/model/h8/layout.c does not compile if an offset is
 * wrong.
 *
 * Every field of such a struct is listed, in the struct's order, so that two fields cannot be exchanged unnoticed.
 */
#ifndef BRICKPILOT_CORE_H8_LAYOUT_H
#define BRICKPILOT_CORE_H8_LAYOUT_H

/* core/fix.h, core/curve.h */
#define VECTOR_X 0
#define VECTOR_Y 2
#define CURVE_EVERY_8TH 0
#define CURVE_BENDS 66
#define LAYOUT_OF_CORE(X)                                                                                              \
    X(fix_vector_t, x, VECTOR_X)                                                                                       \
    X(fix_vector_t, y, VECTOR_Y)                                                                                       \
    X(curve_t, every_8th, CURVE_EVERY_8TH)                                                                             \
    X(curve_t, bends, CURVE_BENDS)

/* core/signals.h, model/scale.h, model/motor.h */
#define MOTION_SURGE 0
#define MOTION_SWAY 4
#define MOTION_YAW_RATE 8
#define SCALE_MANTISSA 0
#define SCALE_SHIFT 2
#define ROW_FROM_CURRENT 0
#define ROW_FROM_SPEED 4
#define ROW_FROM_VOLTAGE 8
#define MOTOR_COEFFICIENTS_CURRENT 0
#define MOTOR_COEFFICIENTS_SPEED 12
#define MOTOR_CURRENT 0
#define MOTOR_SPEED 4
#define LAYOUT_OF_MOTOR(X)                                                                                             \
    X(signals_motion_t, surge_mm_s_q17, MOTION_SURGE)                                                                  \
    X(signals_motion_t, sway_mm_s_q17, MOTION_SWAY)                                                                    \
    X(signals_motion_t, yaw_rate_mrad_s_q12, MOTION_YAW_RATE)                                                          \
    X(scale_t, mantissa, SCALE_MANTISSA)                                                                               \
    X(scale_t, shift, SCALE_SHIFT)                                                                                     \
    X(motor_row_t, from_current, ROW_FROM_CURRENT)                                                                     \
    X(motor_row_t, from_speed, ROW_FROM_SPEED)                                                                         \
    X(motor_row_t, from_voltage, ROW_FROM_VOLTAGE)                                                                     \
    X(motor_coefficients_t, current, MOTOR_COEFFICIENTS_CURRENT)                                                       \
    X(motor_coefficients_t, speed, MOTOR_COEFFICIENTS_SPEED)                                                           \
    X(motor_state_t, current_ua_q7, MOTOR_CURRENT)                                                                     \
    X(motor_state_t, speed_mrad_s_q13, MOTOR_SPEED)

/* model/body.h. The second elements of both arrays are listed, too. */
#define COEFFICIENTS_PROFILE 0
#define COEFFICIENTS_MOTOR 2
#define COEFFICIENTS_MOTOR_1 26
#define COEFFICIENTS_DRAG 50
#define COEFFICIENTS_SURGE_FROM_WHEEL 54
#define COEFFICIENTS_QUARTER_WHEEL_FROM_SURGE 58
#define COEFFICIENTS_YAW_RATE_FROM_WHEEL 62
#define STATE_MOTOR 0
#define STATE_MOTOR_1 8
#define STATE_MOTION 16
#define LAYOUT_OF_BODY(X)                                                                                              \
    X(body_coefficients_t, profile, COEFFICIENTS_PROFILE)                                                              \
    X(body_coefficients_t, motor, COEFFICIENTS_MOTOR)                                                                  \
    X(body_coefficients_t, motor[1], COEFFICIENTS_MOTOR_1)                                                             \
    X(body_coefficients_t, drag, COEFFICIENTS_DRAG)                                                                    \
    X(body_coefficients_t, surge_from_wheel, COEFFICIENTS_SURGE_FROM_WHEEL)                                            \
    X(body_coefficients_t, quarter_wheel_from_surge, COEFFICIENTS_QUARTER_WHEEL_FROM_SURGE)                            \
    X(body_coefficients_t, yaw_rate_from_wheel, COEFFICIENTS_YAW_RATE_FROM_WHEEL)                                      \
    X(body_state_t, motor, STATE_MOTOR)                                                                                \
    X(body_state_t, motor[1], STATE_MOTOR_1)                                                                           \
    X(body_state_t, motion, STATE_MOTION)

/* A build with more functions has these fields after the fields above. No assembly reads them. */
#define COEFFICIENTS_TRAVEL_FROM_SPEED 66
#define COEFFICIENTS_HEADING_FROM_YAW_RATE 70
#define COEFFICIENTS_THRUST_FROM_VOLTAGE 74
#define COEFFICIENTS_THRUST_FROM_WHEEL 78
#define COEFFICIENTS_YAW_RATE_FROM_THRUST 82
#define STATE_VELOCITY_X 28
#define STATE_VELOCITY_Y 32
#define STATE_HEADING 36
#define STATE_X 40
#define STATE_Y 44
#define STATE_X_REST 48
#define STATE_Y_REST 50
#define LAYOUT_OF_LARGER_BODY(X)                                                                                       \
    X(body_coefficients_t, travel_from_speed, COEFFICIENTS_TRAVEL_FROM_SPEED)                                          \
    X(body_coefficients_t, heading_from_yaw_rate, COEFFICIENTS_HEADING_FROM_YAW_RATE)                                  \
    X(body_coefficients_t, thrust_from_voltage, COEFFICIENTS_THRUST_FROM_VOLTAGE)                                      \
    X(body_coefficients_t, thrust_from_wheel, COEFFICIENTS_THRUST_FROM_WHEEL)                                          \
    X(body_coefficients_t, yaw_rate_from_thrust, COEFFICIENTS_YAW_RATE_FROM_THRUST)                                    \
    X(body_state_t, velocity_x_mm_s_q17, STATE_VELOCITY_X)                                                             \
    X(body_state_t, velocity_y_mm_s_q17, STATE_VELOCITY_Y)                                                             \
    X(body_state_t, heading_bam32, STATE_HEADING)                                                                      \
    X(body_state_t, x_um, STATE_X)                                                                                     \
    X(body_state_t, y_um, STATE_Y)                                                                                     \
    X(body_state_t, x_rest_um_q12, STATE_X_REST)                                                                       \
    X(body_state_t, y_rest_um_q12, STATE_Y_REST)

#endif
