#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->dry[DRY_YAW] += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "moment",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .meaning = "dry moment of the tyres' contact patches and of all else that slides sideways in a turn",
     .minimum = 0,
     .maximum = 1e4,
     .preset = 0.012},
};

const effect_t effect_yaw_scrub = {
    .info = {.name = "yaw_scrub",
             .words = "tyres that scrub when the vehicle turns",
             .summary = "The tyres' contact patches resist turning with a dry moment.",
             .mechanism = "tyre",
             .acts_on = "body",
             .equation = "N = -moment sign(r) while the vehicle turns; at rest it holds any moment up to that size. "
                         "Not for a motor",
             .source = "turning resistance of a tyre on the spot, Wong 2008, Theory of Ground Vehicles; solved as a "
                       "bounded impulse, Moreau 1988",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every tyre has a contact patch, which scrubs when the vehicle turns.",
             .advice = "Use narrower or harder tyres, or move weight off the caster.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
