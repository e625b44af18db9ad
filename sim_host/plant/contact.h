/* contact.h: what joins the wheels to the body. One of three, by vehicle and profile. */
#ifndef BRICKPILOT_PLANT_CONTACT_H
#define BRICKPILOT_PLANT_CONTACT_H

#include "plant/wheels.h"

typedef struct {
    /* Before a body step: the wheels' inertia, drag, load and dry arms, from the body's working values. */
    void (*prepare)(wheels_t *wheels, const vehicle_t *vehicle);

    /* After the motor steps of a body step of `step` s that began in `before`: the body's speeds, specific force and
     * pose. */
    void (*finish)(vehicle_t *vehicle, const bp_state *before, double step);
} contact_t;

/* Coupled profile: wheels that neither slip nor slide: u = r_w (w_l + w_r) / 2, r = r_w (w_l - w_r) / (2 half_track), v
 * = 0. The tyre forces vanish from the equations; the wheels feel the vehicle's mass and yaw inertia instead. */
extern const contact_t contact_no_slip;

/* Paper profile: the wheels turn alone (eq. 14), the body is pushed by eq. 15 to 17 (eq. 1 to 9). */
extern const contact_t contact_paper;

/* BP_MOTOR: the mass is driven through the wheel radius, or directly where the input commands force. */
extern const contact_t contact_load;

/* The contact of this vehicle. */
const contact_t *contact_of(int vehicle, int profile);

/* m per rad of a motor's load: the wheel radius, or 1 where the input commands force. */
double contact_load_lever(const double *parameter);

#endif
