#include "plant/body.h"
#include "plant/contact.h"

/* A body that resists u with `surge` and r with `yaw` (masses, or drags), as two wheels of this radius and half-track
 * feel it. */
static pair_t at_wheels(double surge, double yaw, double radius, double half_track)
{
    const double sum = 0.25 * radius * radius * surge;
    const double difference = 0.25 * radius * radius * yaw / (half_track * half_track);
    return (pair_t){.left = sum + difference, .right = sum + difference, .cross = sum - difference};
}

static void prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    const double *p = vehicle->parameter;
    const double radius = p[PARAMETER_WHEEL_RADIUS], half_track = p[PARAMETER_HALF_TRACK];
    wheels->inertia = at_wheels(p[PARAMETER_MASS], p[PARAMETER_YAW_INERTIA], radius, half_track);
    wheels->inertia.left += vehicle->motor[0].inertia;
    wheels->inertia.right += vehicle->motor[1].inertia;
    wheels->drag = at_wheels(vehicle->drag_surge, vehicle->drag_yaw, radius, half_track);
    wheels->drag.left += vehicle->motor[0].drag;
    wheels->drag.right += vehicle->motor[1].drag;

    const double push = 0.5 * radius * vehicle->force_surge, turn = 0.5 * radius / half_track * vehicle->moment_yaw;
    wheels->load[0] = push + turn;
    wheels->load[1] = push - turn;
    wheels->dry_arm[DRY_LEFT] = 1;
    wheels->dry_arm[DRY_RIGHT] = 1;
    wheels->dry_arm[DRY_SURGE] = 0.5 * radius;
    wheels->dry_arm[DRY_YAW] = 0.5 * radius / half_track;
}

static void finish(vehicle_t *vehicle, const bp_state *before, double step)
{
    bp_state *state = &vehicle->state;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const double half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const double left = radius * (state->wheel_angle[0] - before->wheel_angle[0]);
    const double right = radius * (state->wheel_angle[1] - before->wheel_angle[1]);

    state->surge = 0.5 * radius * (state->wheel_speed[0] + state->wheel_speed[1]);
    state->sway = 0;
    state->yaw_rate = 0.5 * radius / half_track * (state->wheel_speed[0] - state->wheel_speed[1]);
    body_accelerations(vehicle, before, step);
    body_move(state, 0.5 * (left + right), 0, 0.5 * (left - right) / half_track);
}

const contact_t contact_no_slip = {prepare, finish};
