/* contact_load.h: the contact of a BP_MOTOR. The motor drives the mass through the wheel radius, or directly if the
 * input commands a force. */
#ifndef BRICKPILOT_PLANT_CONTACT_LOAD_H
#define BRICKPILOT_PLANT_CONTACT_LOAD_H

#include "plant/contact.h"

/* Travel of a motor's load in m per rad: the wheel radius, or 1 where the input commands a force. */
static inline real_t contact_load_lever(const real_t *parameter)
{
    return choose(parameter[PARAMETER_FORCE_PER_VOLT] > 0, real_of(1), parameter[PARAMETER_WHEEL_RADIUS]);
}

/* A BP_MOTOR has no second wheel. Its equations get an inertia for it, so that they can be solved and its speed stays
 * 0. */
static inline void load_prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    const real_t lever = contact_load_lever(vehicle->parameter);
    const real_t inertia = vehicle->motor[0].inertia + vehicle->build.mass * lever * lever;
    wheels->inertia = (pair_t){.left = inertia, .right = inertia};
    wheels->drag = (pair_t){.left = vehicle->motor[0].drag + vehicle->drag_surge * lever * lever};
    wheels->load[0] = vehicle->force_surge * lever;
    wheels->load[1] = real_of(0);
    wheels->dry_arm[DRY_LEFT] = real_of(1);
    wheels->dry_arm[DRY_RIGHT] = real_of(0);
    wheels->dry_arm[DRY_SURGE] = lever;
    wheels->dry_arm[DRY_YAW] = real_of(0);
}

static inline void load_finish(const wheels_t *wheels, vehicle_t *vehicle, const state_t *before, double step)
{
    (void)wheels;
    state_t *state = &vehicle->state;
    state->surge = contact_load_lever(vehicle->parameter) * state->wheel_speed[0];
    vehicle->surge_rate = (state->surge - before->surge) / step;
}

static const contact_t contact_load = {.prepare = load_prepare, .finish = load_finish};

#endif
