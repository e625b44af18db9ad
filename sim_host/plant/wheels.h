/* wheels.h: both motors and wheels over one motor step: eq. 14 with whatever the contact adds, and dry friction.
 *
 * Implicit midpoint in all that is linear: (M + h/2 D + h K) dw = h (torque(w) + load) + p, where M is the inertia the
 * wheels feel, D the linear losses, K the motors' damping within the step, and p the dry friction's impulse. Where a
 * step does not resolve the motion, 1/2 goes to 1 (implicit Euler): by s^2 / (1 + s^2), s = h (D + K_t K_e / R) / M.
 */
#ifndef BRICKPILOT_PLANT_WHEELS_H
#define BRICKPILOT_PLANT_WHEELS_H

#include "plant/dry.h"
#include "plant/motor.h"

typedef struct {
    /* Set by the contact for a body step. */
    pair_t inertia;            /* kg m^2: M */
    pair_t drag;               /* N m s/rad: D */
    double load[2];            /* N m, driving forward */
    double dry_arm[DRY_COUNT]; /* from vehicle_t.dry to N m at the wheel; 0 where the motion is none of the wheels' */

    /* Kept by the contact where the body moves on its own. Ground speeds are those of the body at either wheel, m/s. */
    struct {
        pair_t inverse;                   /* ground speeds' change by impulses at the wheels, 1/kg */
        pair_t grip;                      /* kg: impulse on the body by the wheels' speed ahead of `free` */
        pair_t mass;                      /* kg: inverse of `inverse` */
        double free[2];                   /* ground speeds at the end of the step without tyre force */
        double sway_impulse;              /* N s */
        double sway_mass;                 /* kg */
        double travel_surge, travel_sway; /* m, since the body step began */
        double turn;                      /* rad */
    } body;

    /* Kept by wheels_prepare. */
    double step; /* s */
    bool floats[2];
    motor_step_t motor[2];
    double weight[2]; /* s: h/2, more where the step is stiff */
    pair_t matrix;    /* M + h/2 D + h K */
    pair_t inverse;

    double energy[2]; /* J: what the drive fed each motor since the caller set it to 0 */
} wheels_t;

/* New coefficients, after the contact, the step h, a motor or its floating changed. */
void wheels_prepare(wheels_t *wheels, const vehicle_t *vehicle, double h);

/* Those of them that follow from the inertia alone, after the contact changed it within a body step. */
void wheels_join(wheels_t *wheels);

/* One motor step with vehicle->voltage, wheel_torque and dry: moves current, wheel_speed and wheel_angle of the state.
 */
void wheels_step(wheels_t *wheels, vehicle_t *vehicle);

#endif
