#include "effects/effect.h"

static void body(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->drag_yaw += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "drag",
     .role = BP_ROLE_SIZE,
     .unit = "N m s/rad",
     .meaning = "moment over yaw rate",
     .minimum = 0,
     .maximum = 1e4,
     .preset = 0.005},
};

const effect_t effect_viscous_scrub = {
    .info = {.name = "viscous_scrub",
             .words = "a moment against turning that grows with the yaw rate",
             .summary = "The tyres' contact patches, or whatever else slides sideways in a turn, resist turning in "
                        "proportion to the yaw rate.",
             .mechanism = "tyre",
             .acts_on = "body",
             .equation = "N = -drag r. Not for a motor",
             .source = "linear yaw damping: Wong 2008, Theory of Ground Vehicles (creep of patches of finite length); "
                       "Fossen 2011, linear damping of a body",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "A contact patch that rolls creeps before it slides, on soft tyres most of all.",
             .advice = "Look at casters and floor: something resists turning, and more so when it is fast.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "yaw_scrub",
             .variation = "viscous"},
    .hook = {[SITE_BODY] = body},
};
