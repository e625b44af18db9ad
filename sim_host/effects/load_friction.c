#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const motor_t *motor = &vehicle->motor[k];
        const real_t voltage = choose(is_nan(vehicle->voltage[k]), real_of(0), vehicle->voltage[k]);
        const real_t torque = motor->torque_constant * vehicle->state.current[k] + motor->torque_per_volt * voltage;
        vehicle->dry[DRY_LEFT + k] += value[0] * real_abs(torque);
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
};

const effect_t effect_load_friction = {
    .info = {.name = "load_friction",
             .words = "dry friction that grows with the motor's torque",
             .summary = "Gears and bearings lose a share of the torque that passes through them.",
             .mechanism = "bearing",
             .acts_on = "wheel",
             .equation = "T_f = -share |T_m| sign(w), T_m: torque of the motor; at rest it holds any torque up to that "
                         "size. A share of its own while the motor brakes would be another torque constant",
             .source = "Duclusaud, Passault, Padois & Daney 2025, Extended Friction Models for the Physics Simulation "
                       "of Servo Actuators: the load-dependent term of model M3, with the torque of the motor as the "
                       "load; solved as a bounded impulse, Moreau 1988",
             .prior = BP_PRIOR_USUAL,
             .prior_reason =
                 "Teeth lose a share of the torque that they carry, which shows in worm gears and long trains.",
             .advice = "Grease the gears, worm gears first: their friction grows with the torque.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "coulomb_friction",
             .variation = "in proportion to the torque",
             .motor_step = 0.003},
    .hook = {[SITE_WHEEL] = wheel},
};
