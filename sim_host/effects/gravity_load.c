#include "effects/effect.h"

/* Uses the angle in the middle of the motor step, so the error is of second order. */
static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const mask_t turns = vehicle->parameter[PARAMETER_FORCE_PER_VOLT] <= 0;
    const state_t *state = &vehicle->state;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const real_t middle = state->wheel_angle[k] + 0.5 * vehicle->step * state->wheel_speed[k];
        real_t cosine, sine;
        real_turn(middle - value[1], &cosine, &sine);
        vehicle->wheel_torque[k] -= choose(turns, value[0] * cosine, real_of(0));
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "torque",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .meaning = "largest torque of gravity: the weight times its distance from the axis",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0.01},
    {.name = "level",
     .role = BP_ROLE_PLACE,
     .unit = "rad",
     .meaning = "angle at which it pulls most against forward motion: the weight is level with the axis",
     .minimum = -3.2,
     .maximum = 3.2,
     .preset = 0,
     .trial = 1.5},
};

const effect_t effect_gravity_load = {
    .info = {.name = "gravity_load",
             .words = "gravity on an arm, or on a wheel out of balance",
             .summary =
                 "What the motor turns is out of balance, so gravity pulls with a torque that follows the angle.",
             .mechanism = "body",
             .acts_on = "wheel",
             .equation = "T = -torque cos(a - level), a: angle of the motor or the wheel, from where its sensor counts",
             .source = "pendulum; Duclusaud, Passault, Padois & Daney 2025, Extended Friction Models for the Physics "
                       "Simulation of Servo Actuators: their test bench",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Wheels and shafts are balanced, but arms and pendulums are not.",
             .advice = "Balance what turns, or add its weight times its distance from the shaft to the model.",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
