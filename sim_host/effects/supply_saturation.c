#include "effects/effect.h"

static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++) {
        const real_t voltage = vehicle->voltage[k]; /* a floating motor is NaN and stays so */
        const real_t least = choose(voltage < -value[0], -value[0], voltage);
        vehicle->voltage[k] = choose(voltage > value[0], value[0], least);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "voltage",
     .role = BP_ROLE_LIMIT,
     .unit = "V",
     .meaning = "largest voltage that reaches a motor, forward and backward",
     .minimum = 0,
     .maximum = 1000,
     .preset = 6,
     .limits = "voltage"},
};

const effect_t effect_supply_saturation = {
    .info = {.name = "supply_saturation",
             .words = "a drive that cannot reach the voltage commanded",
             .summary = "The drive cannot give the motors more than some voltage, whatever is commanded.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = V for |V| <= voltage, otherwise sign(V) voltage",
             .source = "saturation, Khalil 2002, Nonlinear Systems, sec. 1.2.7",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "A drive saturates where commands ask for more than its supply, and many never do.",
             .advice = "Charge the battery, or command no more than the drive can reach.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_DRIVE] = drive},
};
