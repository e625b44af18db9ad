#include "effects/effect.h"

/* memory: voltage at each motor in V, 0 at the run's start. The input is constant in a step, so the mean voltage is
 * exact. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    const mask_t lags = value[0] > 0;
    const real_t a = vehicle->step / value[0];
    const real_t passed = -real_expm1(-a);
    for (int k = 0; k < 2; k++) {
        const real_t wanted = choose(is_nan(vehicle->voltage[k]), real_of(0), vehicle->voltage[k]);
        const real_t missing = wanted - memory[k];
        const real_t behind = wanted - missing * passed / a;
        memory[k] = choose(lags, memory[k] + passed * missing, memory[k]);
        vehicle->voltage[k] = choose(lags & mask_not(is_nan(vehicle->voltage[k])), behind, vehicle->voltage[k]);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "time_constant",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "time constant of the voltage that follows the command",
     .minimum = 0,
     .maximum = 10,
     .preset = 0.08},
};

const effect_t effect_actuator_lag = {
    .info = {.name = "actuator_lag",
             .words = "a lag of the drive behind its command",
             .summary = "The voltage at the motors follows the command gradually instead of at once.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "time_constant dV_motor/dt = V - V_motor, from 0 V at the run's start; a motor that floats "
                         "floats at once",
             .source = "first-order lag, Ogata 2010, Modern Control Engineering, ch. 5",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Some drives ramp or filter the voltage, and plain bridges do not.",
             .advice = "Look for a ramp or a filter in the motor driver's settings, and switch it off.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = 2,
    .hook = {[SITE_DRIVE] = drive},
};
