#include "effects/effect.h"

static void body(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->drag_surge += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "drag",
     .role = BP_ROLE_SIZE,
     .unit = "N s/m",
     .meaning = "force over speed",
     .minimum = 0,
     .maximum = 1e5,
     .preset = 0.5},
};

const effect_t effect_surge_drag = {
    .info = {.name = "surge_drag",
             .words = "a drag that grows in proportion to the speed",
             .summary = "A force against the motion ahead grows in proportion to the speed, and turning is free of it.",
             .mechanism = "body",
             .acts_on = "body",
             .equation = "X = -drag u. Not for a motor, where it is viscous friction",
             .source = "Fossen 2011, Handbook of Marine Craft Hydrodynamics and Motion Control, linear damping",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Only a fluid or something towed damps the surge and leaves the yaw free.",
             .advice = "Look for what the robot drags along: a cable, a caster, soft ground.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "quadratic_drag",
             .variation = "linear in the speed"},
    .hook = {[SITE_BODY] = body},
};
