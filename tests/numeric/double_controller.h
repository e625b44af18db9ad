/* double_controller.h: the firmware's controller once more, in double precision and SI units.
 *
 * Written from the firmware's headers: autopilot/los.h and mode.h, control/pid.h, mixer/mixer.h, app/step.h, eq. 21 and
 * 22. Nothing is rounded, and every constant is the vehicle file's. The estimator is left out: what steers is the true
 * state, as with ideal sensors. Frame and signs are the paper's.
 */
#ifndef BRICKPILOT_TESTS_DOUBLE_CONTROLLER_H
#define BRICKPILOT_TESTS_DOUBLE_CONTROLLER_H

#include <stdbool.h>

#include "brickpilot_sim.h"

/* Names and units (SI) of the vehicle file's [controller.*]; acceptance is half the robot's length. */
typedef struct {
    double acceptance, bearing_hold, cruise, creep, decel, pivot, align, rest_speed, rest_time, rest_yaw_rate,
        settle_time, overshoot, max_overshoots, skip_failed, leg_timeout;
    double speed_kp, speed_ki, speed_kd, speed_limit, feedforward_share;
    double heading_kp, heading_ki, heading_kd, heading_limit;
    double battery_floor, max_duty, accel_filter_time;
} double_constants_t;

typedef enum { DOUBLE_BRAKE, DOUBLE_TURN, DOUBLE_DRIVE } double_phase_t;

typedef enum { DOUBLE_IDLE, DOUBLE_RUN, DOUBLE_ARRIVED, DOUBLE_FAULT } double_mode_t;

typedef struct {
    double integral; /* V */
    int saturated;   /* the mixer's answer to the last output: 1 gave less than asked, -1 more, 0 gave it in full */
} double_pid_t;

/* All zero to begin with. */
typedef struct {
    double_mode_t mode;
    double_phase_t phase;
    int waypoint; /* index of the one steered to; stays at the last */
    bool last_reached, passing;
    int leg_overshoots, skipped;
    double bearing, pass_bearing, hold_heading; /* rad */
    double quiet_time, leg_time;                /* s */
    double speed_before, accel;                 /* m/s, m/s^2 */
    double_pid_t speed, heading;
} double_controller_t;

typedef struct {
    const double *waypoints; /* count x 2, m; the caller's */
    int count;               /* 1 or more */
} double_route_t;

/* From IDLE to RUN: the next step begins the route at its first waypoint. */
void double_controller_start(const double_constants_t *constants, const double_route_t *route,
                             double_controller_t *state, const bp_state *truth);

/* One step of `period` s: the two motor voltages (left, right) for this true state and battery voltage. */
void double_controller_step(const double_constants_t *constants, const double_route_t *route,
                            double_controller_t *state, const bp_state *truth, double battery, double period,
                            double voltage[2]);

#endif
