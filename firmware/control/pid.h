/* pid.h: one PID controller, eq. 21, with its output in millivolts.
 *
 * Used twice: forward speed (error in mm/s times 16) and heading (error in binary angle). Configuration const, state
 * the caller's, time an argument. Derivative on the measurement, so that a new demand causes no kick. The integrator is
 * kept in output units and held in the direction in which the output cannot follow. Never fails: saturates and counts.
 * The response is the same in both directions: negate every input and the state, and every output is negated.
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
 *
 * pid_h8.S walks along this struct and the next ones: the order counts.
 */
typedef struct {
    int16_t kd_mv_q10; /* mV per rate unit, 0..32767 */
    int16_t kp_mv_q10; /* mV per error unit, 0..32767 */
    int16_t ki_mv_q10; /* mV per error unit and second, 0..32767 */
    int16_t limit_mv;  /* of the output, of the integrator: 0..20000 */
} pid_config_t;

/* All zero is a controller at rest. */
typedef struct {
    int32_t integral_mv_q16; /* within +-limit_mv */
    uint16_t limited_steps;  /* steps in which the output met limit_mv; stays at 65535 */
    uint16_t held_steps;     /* steps in which the integrator was held; stays at 65535 */
} pid_state_t;

typedef struct {
    /* Told to pid_step(). */
    int16_t rate;           /* of change of the measurement, rate units, any; 0 where unknown */
    int16_t error;          /* demand minus measurement, error units, any */
    int16_t feedforward_mv; /* any */
    int8_t saturated;       /* the mixer's answer to the last output: 1 less than asked, -1 more, 0 in full */
    uint8_t period_ms;      /* 1..20; beyond counts as 20 */

    /* Its answer. */
    int8_t limited;          /* 1 the limit cut the output from above, -1 from below, 0 not */
    int16_t output_mv;       /* -limit_mv..limit_mv */
    int16_t proportional_mv; /* its parts, saturated at +-32767, for telemetry */
    int16_t integral_mv;
    int16_t derivative_mv;
} pid_terms_t;

/* Bumpless: sets the integrator so that the next pid_step() with these terms gives `output_mv`, as far as limit_mv allows the
 * integrator to: within 1 mV. The counts are kept. The loop begins its runs at rest, with nothing to take over; it does not call it. */
void pid_start(const pid_config_t *config, pid_state_t *state, const pid_terms_t *terms, int16_t output_mv);

/* No output: all of the answer is 0. Empties the integrator; the counts are kept. */
void pid_stop(pid_state_t *state, pid_terms_t *terms);

/* output = feedforward + kp error + integral - kd rate, limited; the integral is advanced after its use (forward
 * Euler). Each part is rounded to the nearest mV. The integrator's gain is within 0.05 % (0.01 % at 3 ms); each of its
 * steps is rounded towards zero to 2^-14 mV. */
void pid_step(const pid_config_t *config, pid_state_t *state, pid_terms_t *terms);

#endif
