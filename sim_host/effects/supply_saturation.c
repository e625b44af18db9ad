#include "effects/effect.h"

static void drive(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++) {
        if (vehicle->voltage[k] > value[0])
            vehicle->voltage[k] = value[0];
        else if (vehicle->voltage[k] < -value[0])
            vehicle->voltage[k] = -value[0]; /* a floating motor is NaN and neither */
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {"voltage", "V", "most that reaches a motor, forward and backward", 0, 1000, 6, 0},
};

const effect_t effect_supply_saturation = {
    .info = {.name = "supply_saturation",
             .acts_on = "drive",
             .equation = "V_motor = V for |V| <= voltage, otherwise sign(V) voltage",
             .source = "saturation, Khalil 2002, Nonlinear Systems, sec. 1.2.7",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_DRIVE] = drive},
};
