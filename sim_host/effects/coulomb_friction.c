#include "effects/effect.h"

static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->dry[DRY_LEFT] += value[0];
    vehicle->dry[DRY_RIGHT] += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {"torque", "N m", "dry friction torque at each wheel; N where the motor's input commands force", 0, 1000, 0.005, 0},
};

const effect_t effect_coulomb_friction = {
    .info = {.name = "coulomb_friction",
             .acts_on = "wheel",
             .equation = "T_f = -torque sign(w) while the wheel turns; at rest it holds any torque up to that size",
             .source = "Coulomb 1785; solved as a bounded impulse, Moreau 1988",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
