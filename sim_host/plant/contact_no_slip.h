/* contact_no_slip.h: coupled profile, wheels that neither slip nor slide: u = (r_l w_l + r_r w_r) / 2, r = (r_l w_l - r_r w_r) / (2
 * half_track), v = 0. The tyre forces drop out of the equations, and the wheels feel the vehicle's mass and yaw inertia
 * instead. With the centre of mass at (a forward, c right) of the axle's middle (Fossen 2011, ch. 3, in the plane):
 *   m u' - m c r' - m a r^2 = X     (J_z + m (a^2 + c^2)) r' - m c u' + m a u r = N */
#ifndef BRICKPILOT_PLANT_CONTACT_NO_SLIP_H
#define BRICKPILOT_PLANT_CONTACT_NO_SLIP_H

#include "plant/body.h"
#include "plant/contact.h"

/* Converts masses or drags of the body into their values at the wheels. */
static inline pair_t no_slip_at_wheels(const vehicle_t *vehicle, real_t surge, real_t yaw)
{
    const real_t radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS], square = radius * radius;
    const real_t *rim = vehicle->build.rim;
    const real_t half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const pair_t ground = contact_at_wheels(square * surge, square * yaw, half_track);
    return (pair_t){.left = ground.left * rim[0] * rim[0],
                    .right = ground.right * rim[1] * rim[1],
                    .cross = ground.cross * rim[0] * rim[1]};
}

static inline void no_slip_prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    const build_t *build = &vehicle->build;
    const real_t radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const real_t half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const real_t forward = build->com_forward, right = build->com_right;
    const real_t yaw_inertia = build->yaw_inertia + build->mass * (forward * forward + right * right);
    const real_t turn_gain = 0.5 * radius / half_track; /* ratio of yaw rate to difference of wheel speeds */
    const real_t couple = radius * turn_gain * build->mass * right;
    wheels->inertia = no_slip_at_wheels(vehicle, build->mass, yaw_inertia);
    wheels->inertia.left += vehicle->motor[0].inertia - couple * build->rim[0] * build->rim[0];
    wheels->inertia.right += vehicle->motor[1].inertia + couple * build->rim[1] * build->rim[1];
    wheels->drag = no_slip_at_wheels(vehicle, vehicle->drag_surge, vehicle->drag_yaw);
    wheels->drag.left += vehicle->motor[0].drag;
    wheels->drag.right += vehicle->motor[1].drag;

    const real_t swing = build->mass * forward * vehicle->middle.yaw_rate;
    const real_t force = vehicle->force_surge + swing * vehicle->middle.yaw_rate;
    const real_t moment = vehicle->moment_yaw - swing * vehicle->middle.surge;
    const real_t push = 0.5 * radius * force, turn = turn_gain * moment;
    wheels->load[0] = (push + turn) * build->rim[0];
    wheels->load[1] = (push - turn) * build->rim[1];
    wheels->dry_arm[DRY_LEFT] = real_of(1);
    wheels->dry_arm[DRY_RIGHT] = real_of(1);
    wheels->dry_arm[DRY_SURGE] = 0.5 * radius;
    wheels->dry_arm[DRY_YAW] = turn_gain;
}

static inline void no_slip_finish(const wheels_t *wheels, vehicle_t *vehicle, const state_t *before, double step)
{
    (void)wheels;
    state_t *state = &vehicle->state;
    const real_t *rim = vehicle->build.rim;
    const real_t radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const real_t half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const real_t left = radius * rim[0] * (state->wheel_angle[0] - before->wheel_angle[0]);
    const real_t right = radius * rim[1] * (state->wheel_angle[1] - before->wheel_angle[1]);
    const real_t speed[2] = {rim[0] * state->wheel_speed[0], rim[1] * state->wheel_speed[1]};

    state->surge = 0.5 * radius * (speed[0] + speed[1]);
    state->sway = real_of(0);
    state->yaw_rate = 0.5 * radius / half_track * (speed[0] - speed[1]);
    body_accelerations(vehicle, before, step);
    body_move(state, 0.5 * (left + right), real_of(0), 0.5 * (left - right) / half_track);
}

static const contact_t contact_no_slip = {.prepare = no_slip_prepare, .finish = no_slip_finish};

#endif
