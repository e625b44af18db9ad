#include "effects/effect.h"

#include <math.h>

static void drive(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++) {
        const double voltage = vehicle->voltage[k];
        const double beyond = fabs(voltage) - value[0];
        if (beyond <= 0)
            vehicle->voltage[k] = 0;
        else if (beyond > 0)
            vehicle->voltage[k] = copysign(beyond, voltage); /* a floating motor is NaN and neither */
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {"voltage", "V", "half width of the dead band, each motor", 0, 100, 0.5, 0},
};

const effect_t effect_actuator_deadband = {
    .info = {.name = "actuator_deadband",
             .acts_on = "drive",
             .equation = "V_motor = 0 for |V| <= voltage, otherwise V - sign(V) voltage",
             .source = "Tao & Kokotovic 1994, Adaptive control of plants with unknown dead-zones",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_DRIVE] = drive},
};
