#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->dry[DRY_LEFT] += value[0];
    vehicle->dry[DRY_RIGHT] += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "torque",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .linear_unit = "N",
     .meaning = "dry friction torque at each wheel",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0.005,
     .in_volts = "dry friction in volts"},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->dry_torque[0] += value[0];
    undoable->dry_torque[1] += value[0];
}

const effect_t effect_coulomb_friction = {
    .info = {.name = "coulomb_friction",
             .words = "dry friction at the wheels",
             .summary = "Each wheel loses the same torque whatever its speed, and a smaller torque does not turn it "
                        "at all.",
             .mechanism = "bearing",
             .acts_on = "wheel",
             .equation = "T_f = -torque sign(w) while the wheel turns; at rest it holds any torque up to that size",
             .source = "Coulomb 1785; solved as a bounded impulse, Moreau 1988",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every bearing and brushed motor rubs.",
             .advice = "Turn each wheel by hand: clean and grease axles and bearings, and look for a part that rubs.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
    .undo = undo,
};
