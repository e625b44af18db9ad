#include "effects/effect.h"

#include <math.h>

static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const motor_t *motor = &vehicle->motor[k];
        const double voltage = isnan(vehicle->voltage[k]) ? 0 : vehicle->voltage[k];
        const double torque = motor->torque_constant * vehicle->state.current[k] + motor->torque_per_volt * voltage;
        const double share = value[0] + (torque * vehicle->state.wheel_speed[k] < 0 ? value[1] : 0);
        vehicle->dry[DRY_LEFT + k] += fmax(share, 0) * fabs(torque);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "share",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "dry friction over the size of the motor's torque",
     .minimum = 0,
     .maximum = 0.95,
     .preset = 0.15},
    {.name = "braking",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "the same while the motor brakes, less that while it drives",
     .minimum = -0.95,
     .maximum = 10,
     .preset = 0,
     .optional = 1,
     .trial = 0.15,
     .only_with = "share",
     .variation = "another one while the motor brakes"},
};

const effect_t effect_load_friction = {
    .info = {.name = "load_friction",
             .words = "dry friction that grows with the motor's torque",
             .summary = "Gears and bearings lose a share of the torque that passes through them.",
             .mechanism = "bearing",
             .acts_on = "wheel",
             .equation = "T_f = -share |T_m| sign(w), with share + braking where T_m w < 0; T_m: torque of the motor; "
                         "at rest it holds any torque up to that size",
             .source = "Duclusaud, Passault, Padois & Daney 2025, Extended Friction Models for the Physics Simulation "
                       "of Servo Actuators: the load-dependent term of model M3 with the torque of the motor as the "
                       "load, and a share for each direction of power as in M5; solved as a bounded impulse, Moreau "
                       "1988",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .variant_of = "coulomb_friction",
             .variation = "in proportion to the torque"},
    .hook = {[SITE_WHEEL] = wheel},
};
