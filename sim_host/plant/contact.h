/* contact.h: the contact law between wheels and body. There are four contacts; vehicle, profile and tyres determine
 * which contact applies. */
#ifndef BRICKPILOT_PLANT_CONTACT_H
#define BRICKPILOT_PLANT_CONTACT_H

#include "plant/wheels.h"

typedef struct {
    /* Before a body step: sets the wheels' inertia, drag, load and dry arms from the body's working values. */
    void (*prepare)(wheels_t *wheels, const vehicle_t *vehicle);

    /* After the motor steps of a body step of `step` s that began in `before`: computes the body's speeds, specific
     * force and pose. */
    void (*finish)(const wheels_t *wheels, vehicle_t *vehicle, const state_t *before, double step);

    /* For each motor step of h s, if the body has its own speeds; NULL if the wheel speeds determine them. `expect`
     * estimates the tyres' slip at the step's end. `grip` sets the wheels' inertia and load for this slip. After the
     * step, `overloads` is true if a tyre's force was above its limit, and corrects the estimate: then the step must be
     * repeated from `grip` on. `follow` sets the body's speeds. */
    void (*expect)(wheels_t *wheels, const vehicle_t *vehicle);
    void (*grip)(wheels_t *wheels, vehicle_t *vehicle, double h);
    bool (*overloads)(wheels_t *wheels, const vehicle_t *vehicle, double h);
    void (*follow)(wheels_t *wheels, vehicle_t *vehicle, double h);
} contact_t;

/* Coupled profile, with tyres that slip along the track, sideways, or both: the body has its own surge, sway and yaw
 * rate. */
extern const contact_t contact_slip;

/* Returns the contact of this vehicle. */
const contact_t *contact_of(const vehicle_t *vehicle);

/* Converts the body's masses or drags (`surge` for u, `yaw` for r) into the matrix for the body's ground speeds at the
 * left and the right wheel. */
static inline pair_t contact_at_wheels(real_t surge, real_t yaw, real_t half_track)
{
    const real_t sum = 0.25 * surge, difference = 0.25 * yaw / (half_track * half_track);
    return (pair_t){.left = sum + difference, .right = sum + difference, .cross = sum - difference};
}

#endif
