#include "effects/effect.h"
#include "effects/middle_speed.h"

typedef struct {
    before_t before;
    real_t summed[2]; /* integral of each motor's error since the run's start, V s */
} control_t;

/* The command is the voltage at which an unloaded motor has the wanted speed. So the gains act on a voltage, and their
 * size does not depend on the machine's size. A motor that floats, or has no back EMF, has no such controller. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    control_t *control = (control_t *)memory;
    const real_t emf_constant = vehicle->parameter[PARAMETER_EMF_CONSTANT];
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const real_t wanted = vehicle->voltage[k];
        const real_t error = wanted - emf_constant * middle_speed(memory, vehicle, k);
        const mask_t acts = mask_not(is_nan(wanted)) & mask_not(vehicle->motor[k].torque_per_volt > 0);
        const real_t before = control->summed[k];
        control->summed[k] = choose(acts, before + error * vehicle->step, before);
        const real_t middle = 0.5 * (before + control->summed[k]);
        vehicle->voltage[k] =
            choose(acts, value[0] * wanted + value[1] * error + value[2] * middle, vehicle->voltage[k]);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "feedforward",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "voltage at the motor for each volt that the wanted speed needs without a load",
     .minimum = 0,
     .maximum = 10,
     .preset = 1},
    {.name = "proportional",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning =
         "voltage for each volt by which the back EMF is too small; without a logged voltage or current it shows "
         "only as a smaller resistance",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0},
    {.name = "integral",
     .role = BP_ROLE_SIZE,
     .unit = "1/s",
     .meaning = "voltage for each volt by which the back EMF is too small, and each second of it",
     .minimum = 0,
     .maximum = 1000,
     .preset = 5},
};

const effect_t effect_speed_control = {
    .info = {.name = "speed_control",
             .words = "a speed controller between the command and the motor",
             .summary = "A controller gives each motor the voltage that brings its wheel to the wanted speed.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = feedforward V + proportional (V - K_e w) + integral times the integral of (V - K_e "
                         "w) since the run's start, V the voltage of the wanted speed without a load",
             .source = "PI control with feedforward, Astrom & Hagglund 2006, Advanced PID Control, sec. 3.2 and 5.3",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "A set point reaches a motor through a controller alone.",
             .advice = "Log the voltage or duty that the controller gives, too: then motor and controller can be told "
                       "apart.",
             .parameter_count = 3,
             .parameters = PARAMETERS,
             .stated_by = "reference"},
    .memory_count = sizeof(control_t) / sizeof(real_t),
    .hook = {[SITE_START] = middle_speed_start, [SITE_DRIVE] = drive},
};
