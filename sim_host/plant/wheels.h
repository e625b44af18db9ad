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

    /* Kept by wheels_prepare. */
    double step; /* s */
    bool floats[2];
    motor_step_t motor[2];
    pair_t matrix; /* M + h/2 D + h K */
    pair_t inverse;

    double energy[2]; /* J: what the drive fed each motor since the caller set it to 0 */
} wheels_t;

/* New coefficients, after the contact, the step h, a motor or its floating changed. */
void wheels_prepare(wheels_t *wheels, const vehicle_t *vehicle, double h);

/* One motor step with vehicle->voltage, wheel_torque and dry: moves current, wheel_speed and wheel_angle of the state.
 */
void wheels_step(wheels_t *wheels, vehicle_t *vehicle);

#endif
