#include "effects/effect.h"

#include <math.h>

static void drive(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const double step = value[0] * vehicle->supply;
    if (!(step > 0))
        return;
    for (int k = 0; k < 2; k++) {
        const double rounded = step * round(vehicle->voltage[k] / step);
        vehicle->voltage[k] = fabs(rounded) > vehicle->supply ? copysign(vehicle->supply, rounded) : rounded;
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {"step", "1", "duty from one step to the next; 0: none", 0, 1, 0.125, 0},
};

const effect_t effect_pwm_quantisation = {
    .info = {.name = "pwm_quantisation",
             .acts_on = "drive",
             .equation = "V_motor = V_supply step round(V / (V_supply step)), at most V_supply",
             .source = "uniform quantiser, Widrow & Kollar 2008, Quantization Noise; the RCX's firmware has 8 power "
                       "levels, brickOS 255",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_DRIVE] = drive},
};
