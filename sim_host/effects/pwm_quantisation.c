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
    {.name = "step",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "duty from one level to the next; 0: the drive does not round",
     .minimum = 0,
     .maximum = 1,
     .preset = 0.125,
     .scan_from = 0.003,
     .scan_to = 0.3,
     .scan_count = 120},
};

const effect_t effect_pwm_quantisation = {
    .info = {.name = "pwm_quantisation",
             .words = "the coarse steps of the drive's power levels",
             .summary = "The drive knows a few power levels only and rounds each command to the nearest.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = V_supply step round(V / (V_supply step)), at most V_supply",
             .source = "uniform quantiser, Widrow & Kollar 2008, Quantization Noise; the RCX's firmware has 8 power "
                       "levels, brickOS 255",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Some drives have few power levels, and others have so many that no step shows.",
             .advice = "Use more PWM levels, or switch fast between two of them.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_DRIVE] = drive},
};
