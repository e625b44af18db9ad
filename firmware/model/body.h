/* body.h: the vehicle's motors and body, eq. 2 to 19, in fixed point; one step is STEP_MS.
 *
 * Profile BODY_COUPLED. Wheels neither slip nor slide, so surge = r_w (w_l + w_r) / 2, yaw rate = r_w (w_l - w_r) /
 * (2 half-track), sway = 0, and the tyre force puts the body's inertia onto the wheels. Mean and half difference of
 * both wheels are then two independent motors, with the inertias J + m r_w^2 / 2 and J + J_z r_w^2 /
 * (2 half-track^2). Only air drag (eq. 5) is computed from the speed of the previous step.
 *
 * Profile BODY_PAPER. Each wheel is one motor (eq. 14). Thrust is eq. 15 to 17 with the wheel speed's mean over the
 * step. It acts along the velocity (eq. 6, 7, 9), or along the heading below BODY_REST_SPEED; nothing damps yaw. The
 * velocity is kept in the room's frame, where the Coriolis terms of eq. 2 and 3 vanish, and turned into surge and sway.
 *
 * Both: no branch treats left and right, or forward and backward, differently. Mirror the voltages, and the run is
 * mirrored, bit for bit. All states saturate at the limits below; a floating motor is not modelled.
 */
#ifndef BRICKPILOT_MODEL_BODY_H
#define BRICKPILOT_MODEL_BODY_H

#include "core/signals.h"
#include "model/motor.h"

#define BODY_PERIOD_MS STEP_MS
#define BODY_SPEED_LIMIT_MM_S_Q17 1073479680L      /* 8.19 m/s on either axis: the sum of two speeds fits in 31 bits */
#define BODY_YAW_RATE_LIMIT_MRAD_S_Q12 1966080000L /* 480 rad/s */
#define BODY_REST_SPEED_MM_S_Q17 45875L            /* 0.35 mm/s: a slower motion has no direction */

typedef enum { BODY_COUPLED = 0, BODY_PAPER = 1 } body_profile_t;

/* An image for a small brick holds one profile: -DBODY_WITHOUT_PAPER or -DBODY_WITHOUT_COUPLED. Do not give such an
 * image coefficients of the other profile. If -DBODY_VELOCITY_ONLY is also set, an image without `paper` has only
 * body_predict() and body_correct_surge(), because app/step.c calls no other function. */
#if defined(BODY_WITHOUT_PAPER)
#define BODY_ONLY BODY_COUPLED
#define BODY_IS_PAPER(coefficients) false
#elif defined(BODY_WITHOUT_COUPLED)
#define BODY_ONLY BODY_PAPER
#define BODY_IS_PAPER(coefficients) true
#else
#define BODY_IS_PAPER(coefficients) ((coefficients)->profile == BODY_PAPER)
#endif

/* The generator computes the coefficients from SI values, and proves that nothing overflows. Brackets give the units of
 * input and result. */
typedef struct {
    body_profile_t profile;
    /* Coupled: mean and half difference, with the sum or difference of mV as input. Paper: left and right. */
    motor_coefficients_t motor[2];
    scale_t drag;             /* [(mm/s)^2 q2 to: coupled mrad/s q13 of the mean wheel, paper mm/s q17], per step */
    scale_t surge_from_wheel; /* coupled [mrad/s q13 to mm/s q17] */
    scale_t quarter_wheel_from_surge; /* coupled, [mm/s q17 to mrad/s q13] and divided by 4 */
    scale_t yaw_rate_from_wheel;      /* coupled [mrad/s q13 to mrad/s q12] */
#ifndef BODY_VELOCITY_ONLY
    scale_t travel_from_speed;     /* [mm/s q17 to um q12], per step */
    scale_t heading_from_yaw_rate; /* [mrad/s q12 to bam32], per step */
    scale_t thrust_from_voltage;   /* paper [mV to mm/s q24], per step and wheel, for scale_apply16 */
    scale_t thrust_from_wheel;     /* paper [mrad/s q13 to mm/s q24], per step and wheel */
    scale_t yaw_rate_from_thrust;  /* paper [mm/s q24 to mrad/s q12] */
#endif
} body_coefficients_t;

/* With all fields 0 the vehicle rests at the origin. */
typedef struct {
    motor_state_t motor[2];  /* same order as in coefficients.motor */
    signals_motion_t motion; /* saturates */
#ifndef BODY_VELOCITY_ONLY
    int32_t velocity_x_mm_s_q17; /* paper: velocity in the room's frame */
    int32_t velocity_y_mm_s_q17;
    uint32_t heading_bam32; /* 2^32 = one turn */
    int32_t x_um;           /* +-2147 m, saturates */
    int32_t y_um;
    int16_t x_rest_um_q12; /* the part of x below 1 um */
    int16_t y_rest_um_q12;
#endif
} body_state_t;

/* Currents and speeds of the two wheels, in either profile. */
typedef struct {
    int32_t left_current_ua_q7;
    int32_t right_current_ua_q7;
    int32_t left_mrad_s_q13;
    int32_t right_mrad_s_q13;
} body_wheels_t;

/* One step of the velocities, with both voltages held and limited to +-MOTOR_VOLTAGE_LIMIT_MV. In `paper` it also moves
 * the heading, which thrust needs. It moves neither the heading in `coupled` nor the position. */
void body_predict(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv, int16_t right_mv);

/* One step of velocities, heading and position. */
void body_step(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv, int16_t right_mv);

/* Adds an observer's correction `change_mm_s_q17` (+-8.19 m/s) to the surge, and in `coupled` to both wheel speeds. */
void body_correct_surge(const body_coefficients_t *coefficients, body_state_t *state, int32_t change_mm_s_q17);

void body_wheels(const body_coefficients_t *coefficients, const body_state_t *state, body_wheels_t *wheels);

/* Heading rounded to 1/65536 turn. */
uint16_t body_heading_bam16(const body_state_t *state);

#endif
