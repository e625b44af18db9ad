#include "plant/body.h"
#include "plant/contact.h"

/* Turns masses or drags of the body into those that the wheels feel. */
static pair_t at_wheels(const vehicle_t *vehicle, double surge, double yaw)
{
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS], square = radius * radius;
    const double *rim = vehicle->build.rim;
    const double half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const pair_t ground = contact_at_wheels(square * surge, square * yaw, half_track);
    return (pair_t){.left = ground.left * rim[0] * rim[0],
                    .right = ground.right * rim[1] * rim[1],
                    .cross = ground.cross * rim[0] * rim[1]};
}

static void prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    const build_t *build = &vehicle->build;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const double half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const double forward = build->com_forward, right = build->com_right;
    const double yaw_inertia = build->yaw_inertia + build->mass * (forward * forward + right * right);
    const double turn_gain = 0.5 * radius / half_track; /* yaw rate over difference of wheel speeds */
    const double couple = radius * turn_gain * build->mass * right;
    wheels->inertia = at_wheels(vehicle, build->mass, yaw_inertia);
    wheels->inertia.left += vehicle->motor[0].inertia - couple * build->rim[0] * build->rim[0];
    wheels->inertia.right += vehicle->motor[1].inertia + couple * build->rim[1] * build->rim[1];
    wheels->drag = at_wheels(vehicle, vehicle->drag_surge, vehicle->drag_yaw);
    wheels->drag.left += vehicle->motor[0].drag;
    wheels->drag.right += vehicle->motor[1].drag;

    const double swing = build->mass * forward * vehicle->middle.yaw_rate;
    const double force = vehicle->force_surge + swing * vehicle->middle.yaw_rate;
    const double moment = vehicle->moment_yaw - swing * vehicle->middle.surge;
    const double push = 0.5 * radius * force, turn = turn_gain * moment;
    wheels->load[0] = (push + turn) * build->rim[0];
    wheels->load[1] = (push - turn) * build->rim[1];
    wheels->dry_arm[DRY_LEFT] = 1;
    wheels->dry_arm[DRY_RIGHT] = 1;
    wheels->dry_arm[DRY_SURGE] = 0.5 * radius;
    wheels->dry_arm[DRY_YAW] = turn_gain;
}

static void finish(const wheels_t *wheels, vehicle_t *vehicle, const bp_state *before, double step)
{
    (void)wheels;
    bp_state *state = &vehicle->state;
    const double *rim = vehicle->build.rim;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const double half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const double left = radius * rim[0] * (state->wheel_angle[0] - before->wheel_angle[0]);
    const double right = radius * rim[1] * (state->wheel_angle[1] - before->wheel_angle[1]);
    const double speed[2] = {rim[0] * state->wheel_speed[0], rim[1] * state->wheel_speed[1]};

    state->surge = 0.5 * radius * (speed[0] + speed[1]);
    state->sway = 0;
    state->yaw_rate = 0.5 * radius / half_track * (speed[0] - speed[1]);
    body_accelerations(vehicle, before, step);
    body_move(state, 0.5 * (left + right), 0, 0.5 * (left - right) / half_track);
}

const contact_t contact_no_slip = {.prepare = prepare, .finish = finish};
