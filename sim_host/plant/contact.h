/* contact.h: what joins the wheels to the body. There are four contacts; vehicle, profile and tyres determine which
 * one. */
#ifndef BRICKPILOT_PLANT_CONTACT_H
#define BRICKPILOT_PLANT_CONTACT_H

#include "plant/wheels.h"

typedef struct {
    /* Before a body step: sets the wheels' inertia, drag, load and dry arms from the body's working values. */
    void (*prepare)(wheels_t *wheels, const vehicle_t *vehicle);

    /* After the motor steps of a body step of `step` s that began in `before`: computes the body's speeds, specific
     * force and pose. */
    void (*finish)(const wheels_t *wheels, vehicle_t *vehicle, const bp_state *before, double step);

    /* Where the body moves on its own, for each motor step of h s; NULL where the wheels carry the body along.
     * `expect` guesses how fast the tyres will slip at its end. `grip` sets the wheels' inertia and load as the tyres
     * give way then. After the step, `overloads` is true where a tyre bore more than it can, and corrects the guess: the
     * step is then to be repeated from `grip` on. `follow` sets the body's speeds. */
    void (*expect)(wheels_t *wheels, const vehicle_t *vehicle);
    void (*grip)(wheels_t *wheels, vehicle_t *vehicle, double h);
    bool (*overloads)(wheels_t *wheels, const vehicle_t *vehicle, double h);
    void (*follow)(wheels_t *wheels, vehicle_t *vehicle, double h);
} contact_t;

/* Coupled profile, wheels that neither slip nor slide: u = (r_l w_l + r_r w_r) / 2, r = (r_l w_l - r_r w_r) / (2
 * half_track), v = 0. The tyre forces drop out of the equations, and the wheels feel the vehicle's mass and yaw inertia
 * instead. With the centre of mass at (a forward, c right) of the axle's middle (Fossen 2011, ch. 3, in the plane):
 *   m u' - m c r' - m a r^2 = X     (J_z + m (a^2 + c^2)) r' - m c u' + m a u r = N */
extern const contact_t contact_no_slip;

/* Coupled profile, tyres that slip along the track, sideways, or both: the body has its own surge, sway and yaw
 * rate. */
extern const contact_t contact_slip;

/* Paper profile: the wheels turn alone (eq. 14), the body is pushed by eq. 15 to 17 (eq. 1 to 9). */
extern const contact_t contact_paper;

/* BP_MOTOR: the motor drives the mass through the wheel radius, or directly where the input commands a force. */
extern const contact_t contact_load;

/* Returns the contact of this vehicle. */
const contact_t *contact_of(const vehicle_t *vehicle);

/* Turns a body that resists u with `surge` and r with `yaw` (masses or drags) into the matrix that its ground speeds at
 * the left and the right wheel feel. */
static inline pair_t contact_at_wheels(double surge, double yaw, double half_track)
{
    const double sum = 0.25 * surge, difference = 0.25 * yaw / (half_track * half_track);
    return (pair_t){.left = sum + difference, .right = sum + difference, .cross = sum - difference};
}

/* Travel of a motor's load in m per rad: the wheel radius, or 1 where the input commands a force. */
double contact_load_lever(const double *parameter);

#endif
