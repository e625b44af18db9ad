/* body.h: what both profiles share of eq. 2, 3, 5, 10 and 11. */
#ifndef BRICKPILOT_PLANT_BODY_H
#define BRICKPILOT_PLANT_BODY_H

#include "effects/vehicle.h"

/* Fills `middle`, and sets the body's forces and drags to the nominal ones: the air drag of eq. 5 as a drag that is
 * linear over the body step, 1/2 rho C_d A abs(u) with u extrapolated to its middle. */
void body_prepare(vehicle_t *vehicle, double step);

/* Rates of change and specific force, mean over the body step of `step` s since `before`. */
void body_accelerations(vehicle_t *vehicle, const bp_state *before, double step);

/* Moves the pose by a travel in body axes (m) while the heading turns by `turn` (rad), by the midpoint rule. */
void body_move(bp_state *state, double surge_travel, double sway_travel, double turn);

#endif
