#include "plant/contact.h"

double contact_load_lever(const double *parameter)
{
    return parameter[PARAMETER_FORCE_PER_VOLT] > 0 ? 1 : parameter[PARAMETER_WHEEL_RADIUS];
}

/* The second wheel does not exist. It gets an inertia, so that its equation can be solved and its speed stays 0. */
static void prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    const double lever = contact_load_lever(vehicle->parameter);
    const double inertia = vehicle->motor[0].inertia + vehicle->build.mass * lever * lever;
    wheels->inertia = (pair_t){inertia, inertia, 0};
    wheels->drag = (pair_t){vehicle->motor[0].drag + vehicle->drag_surge * lever * lever, 0, 0};
    wheels->load[0] = vehicle->force_surge * lever;
    wheels->load[1] = 0;
    wheels->dry_arm[DRY_LEFT] = 1;
    wheels->dry_arm[DRY_RIGHT] = 0;
    wheels->dry_arm[DRY_SURGE] = lever;
    wheels->dry_arm[DRY_YAW] = 0;
}

static void finish(const wheels_t *wheels, vehicle_t *vehicle, const bp_state *before, double step)
{
    (void)wheels;
    bp_state *state = &vehicle->state;
    state->surge = contact_load_lever(vehicle->parameter) * state->wheel_speed[0];
    vehicle->surge_rate = (state->surge - before->surge) / step;
}

const contact_t contact_load = {.prepare = prepare, .finish = finish};
