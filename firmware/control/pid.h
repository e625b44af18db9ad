/* pid.h: one PID controller, eq. 21, with its output in millivolts.
 *
 * Used twice: for forward speed (error in mm/s times 16) and for heading (error as binary angle). The derivative acts on
 * the measurement, so that a new demand causes no kick. The integral is kept in mV. Anti-windup: while the output is
 * saturated, the integral does not change in the direction of the saturation. The controller never fails: it
 * saturates, and `limited` says so. The response is the same in both directions: negate every input and the state, and
 * every output is negated.
 */
#ifndef BRICKPILOT_CONTROL_PID_H
#define BRICKPILOT_CONTROL_PID_H

#include <stdint.h>

/* Gains, Q10: 1024 = 1. Error unit: speed 1/16 mm/s, heading 1/65536 turn. Rate unit: speed mm/s^2, heading mrad/s.
 *
 *   speed    kp [V per m/s]     1024 * kp / 16           up to 511 V per m/s
 *            ki [V per m]       1024 * ki / 16
 *            kd [V per m/s^2]   1024 * kd                up to 31.9 V per m/s^2
 *   heading  kp [V per rad]     1024 * kp * 0.09587380   up to 333 V per rad (2000 pi / 65536 = 0.0958738)
 *            ki [V per rad s]   1024 * ki * 0.09587380
 *            kd [V per rad/s]   1024 * kd                up to 31.9 V per rad/s
 */
typedef struct {
    int16_t kp_mv_q10; /* mV per error unit, 0..32767 */
    int16_t ki_mv_q10; /* mV per error unit and second, 0..32767 */
    int16_t kd_mv_q10; /* mV per rate unit, 0..32767 */
    int16_t limit_mv;  /* limit of the output and of the integral, 0..32000 */
} pid_config_t;

/* With all fields 0 the controller is at rest. */
typedef struct {
    int32_t integral_mv_q16; /* within +-limit_mv */
} pid_state_t;

typedef struct {
    int16_t error;          /* demand minus measurement, in error units; any value is allowed */
    int16_t rate;           /* rate of change of the measurement, in rate units, any value; 0 if unknown */
    int16_t feedforward_mv; /* any value is allowed */
    int8_t saturated;       /* the mixer's flag for the last output. 1: the motors got less; -1: more; 0: all of it */
    uint8_t period_ms;      /* 1..20; larger values count as 20 */
} pid_input_t;

typedef struct {
    int16_t output_mv;       /* -limit_mv..limit_mv */
    int16_t proportional_mv; /* the three parts of the output, saturated at +-32767, for telemetry */
    int16_t integral_mv;
    int16_t derivative_mv;
    int8_t limited; /* 1: the output is at +limit_mv, and cut; -1: at -limit_mv, and cut; 0: not cut */
} pid_output_t;

/* Sets the integral so that the next pid_step() with this input gives `output_mv`, within 1 mV and as far as limit_mv
 * allows (bumpless start). The loop does not call this function: its runs start at rest. */
void pid_start(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, int16_t output_mv);

/* Sets all outputs and the integral to 0. */
void pid_stop(pid_state_t *state, pid_output_t *output);

/* output = feedforward + kp error + integral - kd rate, limited. The integral advances after its use (forward Euler).
 * Each part is rounded to the nearest mV. The integral's gain is within 0.05 % (0.01 % at 3 ms); each of its steps is
 * rounded towards zero to 2^-14 mV. */
void pid_step(const pid_config_t *config, pid_state_t *state, const pid_input_t *input, pid_output_t *output);

#endif
