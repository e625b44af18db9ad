#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const state_t *state = &vehicle->state;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const motor_t *motor = &vehicle->motor[k];
        const real_t volts = choose(is_nan(vehicle->voltage[k]), real_of(0), vehicle->voltage[k]);
        const real_t torque = motor->torque_constant * state->current[k] + motor->torque_per_volt * volts;
        const real_t middle = state->wheel_angle[k] + 0.5 * vehicle->step * state->wheel_speed[k];
        const real_t phase = value[2] + (k == 0 ? 0.5 : -0.5) * value[3];
        vehicle->wheel_torque[k] += value[0] * torque * real_sin(value[1] * middle + phase);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "amplitude",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "largest change of the torque, as a share of it",
     .minimum = 0,
     .maximum = 1,
     .preset = 0.3},
    {.name = "order",
     .role = BP_ROLE_SHAPE,
     .unit = "1",
     .linear_unit = "rad/m",
     .meaning = "periods per turn of the wheel",
     .minimum = 0,
     .maximum = 10000,
     .preset = 6},
    {.name = "phase",
     .role = BP_ROLE_SHAPE,
     .unit = "rad",
     .meaning = "phase at wheel angle 0, mean of left and right",
     .minimum = -6.3,
     .maximum = 6.3,
     .preset = 0},
    {.name = "phase_difference",
     .role = BP_ROLE_SHAPE,
     .unit = "rad",
     .meaning = "phase of the left wheel less that of the right; it does nothing on a single motor",
     .minimum = -6.3,
     .maximum = 6.3,
     .preset = 0,
     .odd = 1,
     .optional = 1},
};

const effect_t effect_torque_ripple = {
    .info = {.name = "torque_ripple",
             .words = "a torque that ripples with the wheel's angle",
             .summary = "The torque of a motor rises and falls with the wheel's angle, in proportion to its current.",
             .mechanism = "motor",
             .acts_on = "gear",
             .equation = "T = K_t i (1 + amplitude sin(order angle + phase)), left phase + phase_difference / 2, "
                         "right phase - phase_difference / 2",
             .source = "Jahns & Soong 1996, Pulsating torque minimization techniques for permanent magnet AC motor "
                       "drives, one harmonic",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Motors with few commutator segments ripple, but gears and inertia smooth it.",
             .advice = "Look for a wheel off its centre, a bent shaft or a bad tooth of a gear.",
             .parameter_count = 4,
             .parameters = PARAMETERS,
             .motor_step = 0.003},
    .hook = {[SITE_WHEEL] = wheel},
};
