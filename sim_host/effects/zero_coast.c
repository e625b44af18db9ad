#include "effects/effect.h"
#include "effects/middle_speed.h"

/* A command counts as zero up to this fraction of the battery's nominal voltage: behind a lag, a command is never
 * exactly 0. */
static const double ZERO = 0.01;

/* A motor whose voltage is its own back EMF draws no current. So a fraction of the back EMF removes the same fraction
 * of the braking, and the response is linear in this fraction. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    const real_t zero = ZERO * vehicle->parameter[PARAMETER_BATTERY_VOLTAGE];
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const real_t middle = middle_speed(memory, vehicle, k);
        const real_t voltage = vehicle->voltage[k];
        const real_t coasts = voltage + value[0] * (vehicle->motor[k].emf_constant * middle - voltage);
        vehicle->voltage[k] = choose(real_abs(voltage) <= zero, coasts, voltage); /* a floating motor is NaN */
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "share",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "share of the shorted motor's braking that is missing; 1: the motor floats",
     .minimum = 0,
     .maximum = 1,
     .preset = 0.8},
};

const effect_t effect_zero_coast = {
    .info = {.name = "zero_coast",
             .words = "motors that coast at zero command",
             .summary = "At zero command the drive lets the motors coast, in full or in part, and does not short them.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = V + share (K_e w - V) where |V| <= 1 % of the nominal battery voltage, otherwise V",
             .source = "brake and coast of a motor drive, National Semiconductor LMD18200 data sheet, 1998: shorted or "
                       "open at zero command; a share in between stands for a drive that does both in turn",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Few drives short a motor while they drive and open it at zero command.",
             .advice = "Let the driver brake at zero command, if the robot is to stop at once.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "pwm_coast",
             .variation = "at zero command alone"},
    .memory_count = MIDDLE_SPEED_MEMORY,
    .hook = {[SITE_START] = middle_speed_start, [SITE_DRIVE] = drive},
};
