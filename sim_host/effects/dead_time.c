#include "effects/effect.h"
#include "effects/middle_speed.h"

/* If the command minus the back EMF is smaller than the lost voltage, no current flows: the motor's voltage is then its
 * back EMF in the middle of the step. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const motor_t *motor = &vehicle->motor[k];
        const real_t across = vehicle->voltage[k] - motor->emf_constant * middle_speed(memory, vehicle, k);
        const real_t lost = choose(real_abs(across) <= value[0], across, real_signed(value[0], across));
        const real_t left = vehicle->voltage[k] - lost; /* a floating motor is NaN and stays so */
        vehicle->voltage[k] = choose(motor->torque_per_volt > 0, vehicle->voltage[k], left);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "voltage",
     .role = BP_ROLE_SIZE,
     .unit = "V",
     .meaning = "voltage lost against the current: dead time over period, times the supply, and what the switches drop",
     .minimum = 0,
     .maximum = 100,
     .preset = 0.5},
};

const effect_t effect_dead_time = {
    .info = {.name = "dead_time",
             .words = "a drive that loses voltage against the current",
             .summary = "The drive's switches rest between pulses and drop a voltage, which acts against the motor's "
                        "current.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = V - voltage sign(i), with the sign of V - K_e w; no current flows where |V - K_e "
                         "w| <= voltage. Not where the drive closes a current loop, which makes up for it",
             .source = "Jeong & Park 1991, The analysis and compensation of dead-time effects in PWM inverters, IEEE "
                       "Trans. Industrial Electronics 38(2)",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every switch drops a voltage, and every half bridge has a dead time.",
             .advice = "Use a driver that loses less voltage, or add the lost voltage to each command.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "actuator_deadband",
             .variation = "against the current"},
    .memory_count = MIDDLE_SPEED_MEMORY,
    .hook = {[SITE_START] = middle_speed_start, [SITE_DRIVE] = drive},
};
