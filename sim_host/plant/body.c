#include "plant/body.h"

#include <math.h>

void body_prepare(vehicle_t *vehicle, double step)
{
    const bp_state *state = &vehicle->state;
    const double half = 0.5 * step;
    vehicle->middle.surge = state->surge + half * vehicle->surge_rate;
    vehicle->middle.sway = state->sway + half * vehicle->sway_rate;
    vehicle->middle.yaw_rate = state->yaw_rate + half * vehicle->yaw_accel;
    vehicle->middle.heading = state->heading + half * state->yaw_rate;

    const double air = 0.5 * vehicle->parameter[PARAMETER_AIR_DENSITY] * vehicle->parameter[PARAMETER_DRAG_AREA];
    vehicle->force_surge = 0;
    vehicle->force_sway = 0;
    vehicle->moment_yaw = 0;
    vehicle->drag_surge = air * fabs(vehicle->middle.surge);
    vehicle->drag_sway = air * fabs(vehicle->middle.sway);
    vehicle->drag_yaw = 0;
}

void body_accelerations(vehicle_t *vehicle, const bp_state *before, double step)
{
    const bp_state *state = &vehicle->state;
    const double surge = 0.5 * (before->surge + state->surge), sway = 0.5 * (before->sway + state->sway);
    const double yaw_rate = 0.5 * (before->yaw_rate + state->yaw_rate);
    vehicle->surge_rate = (state->surge - before->surge) / step;
    vehicle->sway_rate = (state->sway - before->sway) / step;
    vehicle->yaw_accel = (state->yaw_rate - before->yaw_rate) / step;
    vehicle->accel_surge = vehicle->surge_rate - sway * yaw_rate;
    vehicle->accel_sway = vehicle->sway_rate + surge * yaw_rate;
}

void body_move(bp_state *state, double surge_travel, double sway_travel, double turn)
{
    const double heading = state->heading + 0.5 * turn;
    const double cosine = cos(heading), sine = sin(heading);
    state->x += surge_travel * cosine - sway_travel * sine;
    state->y += surge_travel * sine + sway_travel * cosine;
    state->heading += turn;
}
