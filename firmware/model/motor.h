/* motor.h: a gear motor with its load, eq. 12 to 14, in fixed point.
 *
 * The states are the current and the speed at the wheel. Rolling friction (eq. 13, with the absolute value of the
 * speed) is linear in speed, so the motor is a linear system. The step is exact for a voltage that is held: the
 * generator takes the matrix exponential. Each step computes the current itself, but only the change of the speed, so
 * that the slow time constant and the final speed are right to 1e-4 of their value.
 *
 * One pair of states stands for a wheel (profile paper), or for the mean or half difference of both wheels (coupled: see
 * body.h); the coefficients say which. The terminals always have a voltage: a floating motor is not modelled.
 * Negate voltage, load and state, and the state after the step is negated, bit for bit.
 */
#ifndef BRICKPILOT_MODEL_MOTOR_H
#define BRICKPILOT_MODEL_MOTOR_H

#include "model/limits.h"
#include "model/scale.h"

#define MOTOR_SPEED_LIMIT_MRAD_S_Q13 (MOTOR_SPEED_LIMIT_MRAD_S_Q13_HIGH * 65536L)

/* Coefficients of a state's new value, or of its change: a weighted sum of current, speed and voltage. The generator
 * refuses parameters if the sum could pass 2^31 within the limits above. */
typedef struct {
    scale_t from_current;
    scale_t from_speed;
    scale_t from_voltage; /* for scale_apply16, input mV */
} motor_row_t;

typedef struct {
    motor_row_t current; /* the new value */
    motor_row_t speed;   /* the change; from_speed is negative: the fraction of the speed that a step loses */
} motor_coefficients_t;

/* With all fields 0 the motor is at rest. */
typedef struct {
    int32_t current_ua_q7;    /* +-16.7 A */
    int32_t speed_mrad_s_q13; /* +-96 rad/s, saturates */
} motor_state_t;

/* One step of STEP_MS at a constant `voltage_mv` (any value). `load_mrad_s_q13` is the change of speed that an external
 * torque causes in this step, +-20 rad/s. */
void motor_step(const motor_coefficients_t *coefficients, motor_state_t *state, int16_t voltage_mv,
                int32_t load_mrad_s_q13);

#endif
