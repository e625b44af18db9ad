/* wheels.h: both motors and wheels over one motor step: eq. 14, what the contact adds to it, and dry friction.
 *
 * The linear part is integrated by the implicit midpoint rule: (M + h/2 D + h K) dw = h (torque(w) + load) + p. M is
 * the inertia that the wheels feel, D the linear losses, K the motors' damping within the step, and p the impulse of
 * dry friction. Where a step does not resolve the motion, 1/2 goes to 1 (implicit Euler) by s^2 / (1 + s^2), with s = h
 * (D + K_t K_e / R) / M.
 */
#ifndef BRICKPILOT_PLANT_WHEELS_H
#define BRICKPILOT_PLANT_WHEELS_H

#include "plant/dry.h"
#include "plant/motor.h"

/* Speeds of the tyres over the floor, m/s. */
typedef struct {
    double along[2]; /* of each wheel's rim ahead of the body */
    double sway;     /* of both */
} slip_t;

typedef struct {
    /* Set by the contact for a body step. */
    pair_t inertia; /* kg m^2: M */
    pair_t drag;    /* N m s/rad: D */
    double load[2]; /* N m, driving forward */
    double dry_arm
        [DRY_COUNT]; /* factor from vehicle_t.dry to N m at the wheel; 0 where the wheels do not carry the motion */

    /* For the contact alone, where the body moves on its own. Ground speeds are those of the body at each wheel,
     * m/s. */
    struct {
        pair_t inverse;                   /* 1/kg: change of the ground speeds by impulses at the wheels */
        pair_t grip;                      /* kg: impulse on the body by the wheels' speed ahead of `free` */
        pair_t mass;                      /* kg: inverse of `inverse` */
        double free[2];                   /* m/s: ground speeds at the end of the step without tyre force */
        double sway_impulse;              /* N s */
        double sway_mass;                 /* kg */
        double travel_surge, travel_sway; /* m, since the body step began */
        double turn;                      /* rad */
        slip_t slip;                      /* at the start of the motor step; only where has_slip */
        bool has_slip;
        slip_t ahead;   /* at the end of the motor step, as it is expected: the tyres hold as they do there */
        double soft[2]; /* 1/kg: slip speed over impulse of each tyre in this step, with `ahead` */
    } body;

    /* Set by wheels_prepare(). */
    double step; /* s */
    bool floats[2];
    motor_step_t motor[2];
    double weight[2]; /* s: h/2, more where the step is stiff */
    pair_t matrix;    /* M + h/2 D + h K */
    pair_t inverse;

    double energy[2]; /* J: what the drive fed each motor since the caller set it to 0 */
} wheels_t;

/* Computes all coefficients anew. Call it when the contact, the step h or a motor has changed, or a motor has begun or
 * stopped floating. */
void wheels_prepare(wheels_t *wheels, const vehicle_t *vehicle, double h);

/* Computes the coefficients that follow from the inertia alone. Call it when the contact has changed that within a body
 * step. */
void wheels_join(wheels_t *wheels);

/* Does one motor step with vehicle->voltage, wheel_torque and dry: changes current, wheel_speed and wheel_angle of the
 * state. */
void wheels_step(wheels_t *wheels, vehicle_t *vehicle);

#endif
