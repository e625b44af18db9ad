#include "effects/effect.h"

/* memory: voltage at each motor in V, 0 at the run's start. The input is constant in a step, so the mean voltage of a
 * ramp is exact, whether the ramp ends within the step or later. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    const mask_t ramps = value[0] > 0;
    const real_t reach = vehicle->step / value[0];
    for (int k = 0; k < 2; k++) {
        const real_t wanted = choose(is_nan(vehicle->voltage[k]), real_of(0), vehicle->voltage[k]);
        const real_t missing = wanted - memory[k];
        const mask_t ends = real_abs(missing) <= reach;
        const real_t passed = choose(ends, missing, real_signed(reach, missing));
        const real_t mean =
            choose(ends, wanted - 0.5 * missing * (real_abs(missing) / reach), memory[k] + 0.5 * passed);
        memory[k] = choose(ramps, memory[k] + passed, memory[k]);
        vehicle->voltage[k] = choose(ramps & mask_not(is_nan(vehicle->voltage[k])), mean, vehicle->voltage[k]);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "time_per_volt",
     .role = BP_ROLE_SIZE,
     .unit = "s/V",
     .meaning =
         "time in which the voltage changes by 1 V; a controller's ramp to full voltage, divided by that voltage",
     .minimum = 0,
     .maximum = 10,
     .preset = 0.02},
};

const effect_t effect_slew_limit = {
    .info = {.name = "slew_limit",
             .words = "a drive that limits how fast its voltage changes",
             .summary = "The voltage at the motors climbs and falls at a limited rate, and reaches the command later.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation =
                 "|dV_motor/dt| <= 1 / time_per_volt, from 0 V at the run's start; a motor that floats floats at "
                 "once",
             .source = "rate saturation, Hippe 2006, Windup in Control; \"open-loop ramp rate\" of motor "
                       "controllers for robots",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Controllers of larger motors ramp their voltage if asked to, and plain bridges do not.",
             .advice = "Set the ramp in the motor controller's settings to 0, or command no faster than it.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "actuator_lag",
             .variation = "at a limited rate"},
    .memory_count = 2,
    .hook = {[SITE_DRIVE] = drive},
};
