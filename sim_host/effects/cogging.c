#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const state_t *state = &vehicle->state;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const real_t middle = state->wheel_angle[k] + 0.5 * vehicle->step * state->wheel_speed[k];
        const real_t phase = value[2] + (k == 0 ? 0.5 : -0.5) * value[3];
        vehicle->wheel_torque[k] -= value[0] * real_sin(value[1] * middle + phase);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "torque",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .linear_unit = "N",
     .meaning = "largest pull, at each wheel",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0.02},
    {.name = "order",
     .role = BP_ROLE_SHAPE,
     .unit = "1",
     .linear_unit = "rad/m",
     .meaning = "rest positions per turn of the wheel",
     .minimum = 0,
     .maximum = 10000,
     .preset = 6},
    {.name = "phase",
     .role = BP_ROLE_SHAPE,
     .unit = "rad",
     .meaning = "phase at wheel angle 0, mean of left and right; 0: the wheel is at a rest position",
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

const effect_t effect_cogging = {
    .info = {.name = "cogging",
             .words = "motors that cog, pulled towards rest positions",
             .summary = "Magnets pull each motor towards a few rest positions per turn, with or without current.",
             .mechanism = "motor",
             .acts_on = "gear",
             .equation = "T_c = -torque sin(order angle + phase), left phase + phase_difference / 2, right phase - "
                         "phase_difference / 2",
             .source = "Jahns & Soong 1996, Pulsating torque minimization techniques for permanent magnet AC motor "
                       "drives, one harmonic",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Rotors with iron teeth cog, and coreless ones do not.",
             .advice = "Keep the motors above their slowest speeds, or use motors that cog less.",
             .parameter_count = 4,
             .parameters = PARAMETERS,
             .motor_step = 0.003,
             .variant_of = "torque_ripple",
             .variation = "without current too",
             .contains = "gravity_load"},
    .hook = {[SITE_WHEEL] = wheel},
};
