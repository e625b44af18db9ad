#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++) {
        const real_t speed = vehicle->state.wheel_speed[k] / value[2];
        vehicle->dry[DRY_LEFT + k] += value[0] + value[1] * real_exp(-speed * speed);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "coulomb",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .linear_unit = "N",
     .meaning = "dry friction of a wheel that turns fast",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0.003},
    {.name = "breakaway",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .linear_unit = "N",
     .meaning = "friction at rest beyond that",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0.004,
     .only_with = "coulomb"},
    {.name = "stribeck_speed",
     .role = BP_ROLE_SHAPE,
     .unit = "rad/s",
     .linear_unit = "m/s",
     .meaning = "wheel speed at which 1/e of the breakaway is left",
     .minimum = 1e-4,
     .maximum = 1000,
     .preset = 1},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->dry_torque[0] += value[0];
    undoable->dry_torque[1] += value[0];
}

const effect_t effect_stiction_stribeck = {
    .info = {.name = "stiction_stribeck",
             .words = "dry friction at the wheels that is larger near standstill",
             .summary = "Each wheel needs more torque to start than to keep turning.",
             .mechanism = "bearing",
             .acts_on = "wheel",
             .equation = "T_f = -(coulomb + breakaway exp(-(w / stribeck_speed)^2)) sign(w) while the wheel turns; at "
                         "rest it holds any torque up to coulomb + breakaway",
             .source = "Armstrong-Helouvry, Dupont & Canudas de Wit 1994, Automatica 30(7): Gaussian Stribeck curve; "
                       "solved as a bounded impulse, Moreau 1988",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Nearly every dry or greased contact has stiction, which falls as a film builds up.",
             .advice = "Clean and grease axles and bearings, and start from rest with a short kick.",
             .parameter_count = 3,
             .parameters = PARAMETERS,
             .variant_of = "coulomb_friction",
             .variation = "larger near standstill",
             .contains = "coulomb_friction"},
    .hook = {[SITE_WHEEL] = wheel},
    .undo = undo,
};
