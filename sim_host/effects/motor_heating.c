#include "effects/effect.h"

/* Temperature coefficient of copper at 20 degrees C (IEC 60028), 1/K. It is not a parameter, because it is known and
 * acts only in its product with the thermal resistance. */
static const double COPPER = 0.00393;

static void start(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++)
        vehicle->state.heat[k] *= real_exp(-vehicle->state.rest / value[1]);
}

static void motor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    (void)memory;
    for (int k = 0; k < 2; k++)
        vehicle->motor[k].resistance *= 1 + COPPER * vehicle->state.heat[k];
}

/* Runs each motor step, because the current may come in pulses that are shorter than a body step. */
static void warm(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    state_t *state = &vehicle->state;
    for (int k = 0; k < 2; k++) {
        const real_t power = vehicle->motor[k].resistance * state->current[k] * state->current[k];
        state->heat[k] += vehicle->step / value[1] * (value[0] * power - state->heat[k]);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "thermal_resistance",
     .role = BP_ROLE_SIZE,
     .unit = "K/W",
     .meaning = "thermal resistance from winding to surroundings",
     .minimum = 0,
     .maximum = 10000,
     .preset = 300},
    {.name = "time_constant",
     .role = BP_ROLE_SHAPE,
     .unit = "s",
     .meaning = "time constant of the winding's temperature",
     .minimum = 1,
     .maximum = 100000,
     .preset = 20},
};

const effect_t effect_motor_heating = {
    .info = {.name = "motor_heating",
             .words = "windings that grow warm, and so resist more",
             .summary = "The motors' current heats their windings, whose resistance grows with temperature.",
             .mechanism = "motor",
             .acts_on = "motor",
             .equation = "R' = R (1 + 0.00393 T), time_constant dT/dt = thermal_resistance R' i^2 - T; T in K above "
                         "the surroundings, carried from run to run",
             .source = "one-body thermal model, Hughes & Drury 2019, Electric Motors and Drives; copper: IEC 60028",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Copper resists more as it warms, which takes longer than many runs.",
             .advice = "Let the motors cool between runs, or drive them less hard.",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .carries_over = 1},
    .hook = {[SITE_START] = start, [SITE_MOTOR] = motor, [SITE_WHEEL] = warm},
};
