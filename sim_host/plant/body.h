/* body.h: the parts of eq. 2, 3, 5, 10 and 11 that both profiles share. */
#ifndef BRICKPILOT_PLANT_BODY_H
#define BRICKPILOT_PLANT_BODY_H

#include "effects/vehicle.h"

/* Fills `middle`, and sets the body's forces and drags to the nominal ones. The air drag of eq. 5 is a linear drag in
 * each body step, 1/2 rho C_d A abs(u), with u extrapolated to the middle of the step. */
void body_prepare(vehicle_t *vehicle, double step);

/* Computes the rates of change and the specific force: means over the body step of `step` s since `before`. */
void body_accelerations(vehicle_t *vehicle, const bp_state *before, double step);

/* Moves the pose by a travel in body axes (m) while the heading turns by `turn` (rad), by the midpoint rule. */
void body_move(bp_state *state, double surge_travel, double sway_travel, double turn);

#endif
