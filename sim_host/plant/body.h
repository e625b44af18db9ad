/* body.h: the parts of eq. 2, 3, 5, 10 and 11 that both profiles share. */
#ifndef BRICKPILOT_PLANT_BODY_H
#define BRICKPILOT_PLANT_BODY_H

#include "effects/vehicle.h"

/* Fills `middle`, and sets the body's forces and drags to their nominal values. In each body step the air drag of eq. 5
 * is a linear drag, 1/2 rho C_d A abs(u), with u extrapolated to the middle of the step. */
static inline void body_prepare(vehicle_t *vehicle, double step)
{
    const state_t *state = &vehicle->state;
    const double half = 0.5 * step;
    vehicle->middle.surge = state->surge + half * vehicle->surge_rate;
    vehicle->middle.sway = state->sway + half * vehicle->sway_rate;
    vehicle->middle.yaw_rate = state->yaw_rate + half * vehicle->yaw_accel;
    vehicle->middle.heading = state->heading + half * state->yaw_rate;

    const real_t air = 0.5 * vehicle->parameter[PARAMETER_AIR_DENSITY] * vehicle->parameter[PARAMETER_DRAG_AREA];
    vehicle->force_surge = real_of(0);
    vehicle->force_sway = real_of(0);
    vehicle->moment_yaw = real_of(0);
    vehicle->drag_surge = air * real_abs(vehicle->middle.surge);
    vehicle->drag_sway = air * real_abs(vehicle->middle.sway);
    vehicle->drag_yaw = real_of(0);
}

/* Computes the rates of change and the specific force: means over the body step of `step` s since `before`. */
static inline void body_accelerations(vehicle_t *vehicle, const state_t *before, double step)
{
    const state_t *state = &vehicle->state;
    const real_t surge = 0.5 * (before->surge + state->surge), sway = 0.5 * (before->sway + state->sway);
    const real_t yaw_rate = 0.5 * (before->yaw_rate + state->yaw_rate);
    vehicle->surge_rate = (state->surge - before->surge) / step;
    vehicle->sway_rate = (state->sway - before->sway) / step;
    vehicle->yaw_accel = (state->yaw_rate - before->yaw_rate) / step;
    vehicle->accel_surge = vehicle->surge_rate - sway * yaw_rate;
    vehicle->accel_sway = vehicle->sway_rate + surge * yaw_rate;
}

/* Moves the pose by a travel in body axes (m) while the heading turns by `turn` (rad), by the midpoint rule. */
static inline void body_move(state_t *state, real_t surge_travel, real_t sway_travel, real_t turn)
{
    const real_t heading = state->heading + 0.5 * turn;
    real_t cosine, sine;
    real_turn(heading, &cosine, &sine);
    state->x += surge_travel * cosine - sway_travel * sine;
    state->y += surge_travel * sine + sway_travel * cosine;
    state->heading += turn;
}

#endif
