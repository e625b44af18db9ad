#include "effects/effect.h"

static void motor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++)
        vehicle->motor[k].drag += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "drag",
     .role = BP_ROLE_SIZE,
     .unit = "N m s/rad",
     .linear_unit = "N s/m",
     .meaning = "loss of each wheel over its speed",
     .minimum = 0,
     .maximum = 1e5,
     .preset = 4e-4,
     .same_as = "viscous_friction"},
};

const effect_t effect_viscous_loss = {
    .info = {.name = "viscous_loss",
             .words = "viscous friction at the wheels",
             .summary = "Each wheel loses a torque in proportion to its speed, where the nominal model has none.",
             .mechanism = "bearing",
             .acts_on = "motor",
             .equation = "T_f = -drag w, in addition to the nominal viscous_friction; missing only where that is 0",
             .source = "viscous friction of lubricated bearings, Armstrong-Helouvry et al. 1994, Automatica 30(7)",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Grease makes viscous friction, but most simulators have that term already.",
             .advice = "Look for a tight bearing, and warm up or thin the grease in the gears.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "coulomb_friction",
             .variation = "viscous"},
    .hook = {[SITE_MOTOR] = motor},
};
