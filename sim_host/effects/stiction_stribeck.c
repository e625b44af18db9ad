#include "effects/effect.h"

#include <math.h>

static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++) {
        const double speed = vehicle->state.wheel_speed[k] / value[2];
        vehicle->dry[DRY_LEFT + k] += value[0] + value[1] * exp(-speed * speed);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {"coulomb", "N m", "dry friction of a wheel that turns fast; N where the motor's input commands force", 0, 1000,
     0.003, 0},
    {"breakaway", "N m", "what holds a wheel at rest beyond that; N where the motor's input commands force", 0, 1000,
     0.004, 0},
    {"stribeck_speed", "rad/s", "wheel speed at which 1/e of it is left; m/s where the motor's input commands force",
     1e-4, 1000, 1, 0},
};

const effect_t effect_stiction_stribeck = {
    .info = {.name = "stiction_stribeck",
             .acts_on = "wheel",
             .equation = "T_f = -(coulomb + breakaway exp(-(w / stribeck_speed)^2)) sign(w) while the wheel turns; at "
                         "rest it holds any torque up to coulomb + breakaway",
             .source = "Armstrong-Helouvry, Dupont & Canudas de Wit 1994, Automatica 30(7): Gaussian Stribeck curve; "
                       "solved as a bounded impulse, Moreau 1988",
             .parameter_count = 3,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
