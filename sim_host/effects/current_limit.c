#include "effects/effect.h"
#include "effects/middle_speed.h"

/* The drive gives less than the command if the current would be too large. The voltage across the winding is the
 * command minus the back EMF in the middle of the step. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const motor_t *motor = &vehicle->motor[k];
        const real_t emf = motor->emf_constant * middle_speed(memory, vehicle, k);
        const real_t across = vehicle->voltage[k] - emf;
        const mask_t cut = (real_abs(across) > value[0]) & mask_not(motor->torque_per_volt > 0);
        vehicle->voltage[k] = choose(cut, emf + real_signed(value[0], across), vehicle->voltage[k]); /* NaN: floats */
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "voltage",
     .role = BP_ROLE_LIMIT,
     .unit = "V",
     .meaning = "largest voltage across a winding: the largest current, times the resistance",
     .minimum = 0,
     .maximum = 1000,
     .preset = 3,
     .limits = "voltage"},
};

const effect_t effect_current_limit = {
    .info = {.name = "current_limit",
             .words = "a drive that limits the motors' current",
             .summary = "The drive lowers the voltage where the motor would draw more than some current: when it "
                        "starts, stalls or reverses.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = V where |V - K_e w| <= voltage, otherwise K_e w + sign(V - K_e w) voltage; the "
                         "largest current is voltage / R. Not where the drive closes a current loop",
             .source = "current limiting of a chopper drive, Hughes & Drury 2019, Electric Motors and Drives, ch. 4",
             .prior = BP_PRIOR_USUAL,
             .prior_reason =
                 "Controllers of larger motors limit their current, and only hard starts and turns meet it.",
             .advice =
                 "Raise the limit in the controller's settings as far as motor and battery bear it, or accelerate "
                 "more gently.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = MIDDLE_SPEED_MEMORY,
    .hook = {[SITE_START] = middle_speed_start, [SITE_DRIVE] = drive},
};
