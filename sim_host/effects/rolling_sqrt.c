#include "effects/effect.h"

/* Acts as a bound of dry friction: a force whose slope is infinite at rest would make the integration ring. */
static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++)
        vehicle->dry[DRY_LEFT + k] += value[0] * real_root(real_abs(vehicle->state.wheel_speed[k]));
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "torque",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .linear_unit = "N",
     .meaning = "loss of each wheel at 1 rad/s, or at 1 m/s where the input commands force",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0.002},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->root_torque[0] += value[0];
    undoable->root_torque[1] += value[0];
}

const effect_t effect_rolling_sqrt = {
    .info = {.name = "rolling_sqrt",
             .words = "a rolling loss that grows with the root of the speed",
             .summary = "Each wheel loses a torque that grows with the root of its speed.",
             .mechanism = "bearing",
             .acts_on = "wheel",
             .equation = "T_f = -torque sqrt(|w| / 1 rad/s) sign(w)",
             .source = "power law of speed with exponent 1/2, between Coulomb (0) and viscous (1): mixed lubrication, "
                       "Armstrong-Helouvry et al. 1994, Automatica 30(7)",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Mixed lubrication seldom follows a root over the whole range of speeds.",
             .advice = "Harden the tyres, and drive on a harder floor.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "coulomb_friction",
             .variation = "growing with the root of the speed"},
    .hook = {[SITE_WHEEL] = wheel},
    .undo = undo,
};
