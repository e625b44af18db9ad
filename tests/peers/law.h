/* law.h: the control law that the firmware and its peers compute: line of sight, two PIDs and the mixer, once a step.
 *
 * law.c writes it in SI units on numbers `num` and the five functions below. It is built with one of
 *   NUM_Q16    q16.c: 32 bits with 16 behind the point, as libfixmath has them; ours, not libfixmath
 *   NUM_FLOAT  soft_float.c: float, by the compiler's or the system's routines in software
 * and ours.c is the same law by the firmware's own functions. Rules that decide on the phase of a leg, and the estimator, are left out: a
 * record has their results. So every program gets the same inputs, and its answers can be compared step by step.
 */
#ifndef BRICKPILOT_TESTS_PEERS_LAW_H
#define BRICKPILOT_TESTS_PEERS_LAW_H

#include <stdint.h>

/* As firmware/autopilot/los.h has them. */
enum { PHASE_BRAKE = 1, PHASE_TURN = 2, PHASE_DRIVE = 3 };

#ifdef NUM_FLOAT
typedef float num;
#define NUM(value) ((float)(value))
#else
typedef int32_t num;
#define NUM(value) ((num)((value)*65536.0 + ((value) < 0 ? -0.5 : 0.5)))
#endif

/* Sums, differences, negatives and comparisons are C's own: no overflow is looked for.
 *
 * Products and quotients are rounded to the nearest. num_sqrt() takes 0 or more. num_atan2() is within 1e-4 rad. */
num num_mul(num a, num b);
num num_div(num a, num b);
num num_sqrt(num value);
num num_atan2(num y, num x);

/* One step of a recorded flight: the estimate, the newest battery voltage, and what the autopilot's rules decided. SI units. A program of
 * the firmware has the formats of its own signals, in `native_t`. */
typedef struct {
    num x, y, heading, speed, accel, yaw_rate, battery;
    uint8_t waypoint, phase;
} record_t;

typedef struct {
    int32_t x_um, y_um;
    uint16_t heading_bam16;
    int16_t speed_mm_s_q4, accel_mm_s2, yaw_rate_mrad_s;
    uint16_t battery_mv;
    uint8_t waypoint, phase;
} native_t;

/* Voltages of the model's motors, and duties. Of num: V, and a share of 1. Of the firmware: mV, and 1/32767. */
typedef struct {
    num left, right, left_duty, right_duty;
} answer_t;

#ifdef NUM_NATIVE
typedef native_t input_t;
#else
typedef record_t input_t;
#endif

/* Sets the law's state to rest. */
void control_begin(void);

/* One step of the firmware's period. */
void control_law(const input_t *input, answer_t *answer);

#endif
