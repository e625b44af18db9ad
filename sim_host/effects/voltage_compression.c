#include "effects/effect.h"

static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const real_t per_volt = value[0] / vehicle->parameter[PARAMETER_BATTERY_VOLTAGE];
    for (int k = 0; k < vehicle_wheels(vehicle); k++)
        vehicle->voltage[k] /= 1 + per_volt * real_abs(vehicle->voltage[k]);
}

/* At -0.9 the gain at full voltage is ten times the gain at 0 V, and still finite. */
static const bp_parameter_info PARAMETERS[] = {
    {.name = "compression",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "gain without voltage over gain at the battery's nominal voltage, less 1",
     .minimum = -0.9,
     .maximum = 10,
     .preset = 0.2,
     .says = "the drive's gain is {} larger for small commands than for full ones",
     .says_below = "the drive's gain is {} smaller for small commands than for full ones"},
};

const effect_t effect_voltage_compression = {
    .info = {.name = "voltage_compression",
             .words = "a drive whose gain falls as the command grows",
             .summary = "The drive gives a smaller share of a large command than of a small one.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = V / (1 + compression |V| / V_battery), V_battery nominal",
             .source = "gain compression of a saturating stage as the plainest rational function of its input; pulse "
                       "width to speed of drives that coast bends in this way: Krishnan 2001, Electric Motor Drives, "
                       "discontinuous current",
             .prior = BP_PRIOR_USUAL,
             .prior_reason =
                 "The gain of a bridge bends where the current is discontinuous, which depends on its pulses.",
             .advice = "Measure the motor's voltage at several commands, and correct the commands by that curve.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "supply_saturation",
             .variation = "gradual"},
    .hook = {[SITE_DRIVE] = drive},
};
