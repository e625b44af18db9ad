#include "effects/effect.h"

typedef struct {
    real_t open;      /* battery voltage without current, V */
    real_t given[2];  /* voltage for each motor that this effect set in the last motor step, V */
    real_t passed[2]; /* fraction of it that the later effects leave: a dead band takes some */
} sag_t;

static void supply(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    ((sag_t *)memory)->open = vehicle->supply;
}

/* The mean current over the step is linear in the voltage; plant/motor.h computes it in the same way, with the speed at
 * the start of the step. So the voltage at which battery and motors agree is exact, for any ratio of the step to L /
 * R. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    sag_t *sag = (sag_t *)memory;
    real_t slope = real_of(0), drawn = slope; /* the battery's current is drawn + slope * V */
    real_t share[2];
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const mask_t driven = mask_not(is_nan(vehicle->voltage[k]));
        const motor_t *motor = &vehicle->motor[k];
        const real_t decay =
            choose(motor->inductance > 0, vehicle->step * motor->resistance / motor->inductance, real_of(INFINITY));
        const real_t left = choose(decay > 0, -real_expm1(-decay) / decay, real_of(1));
        const real_t gain = (1 - left) / motor->resistance;
        share[k] = vehicle->voltage[k] / vehicle->supply;
        const real_t at_motor = share[k] * sag->passed[k];
        const real_t current =
            left * vehicle->state.current[k] - gain * motor->emf_constant * vehicle->state.wheel_speed[k];
        slope = choose(driven, slope + at_motor * at_motor * gain, slope);
        drawn = choose(driven, drawn + at_motor * current, drawn);
    }
    const real_t agreed = (sag->open - value[0] * drawn) / (1 + value[0] * slope);
    vehicle->supply = vehicle_supply_of(vehicle, agreed);
    for (int k = 0; k < vehicle_wheels(vehicle); k++)
        sag->given[k] = vehicle->voltage[k] = share[k] * vehicle->supply; /* a floating motor is NaN and stays so */
}

/* Estimates the fraction of the voltage that the later effects leave. The estimate moves half of the difference in each
 * step, because the fraction that a dead band leaves depends on the voltage. */
static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    sag_t *sag = (sag_t *)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const real_t ratio = vehicle->voltage[k] / sag->given[k];
        const real_t passed = sag->passed[k] + 0.5 * (ratio - sag->passed[k]);
        sag->passed[k] = choose(ratio * 0 == 0, passed, sag->passed[k]); /* where the ratio is finite */
    }
}

static void start(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    (void)vehicle;
    sag_t *sag = (sag_t *)memory;
    sag->passed[0] = sag->passed[1] = real_of(1);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "resistance",
     .role = BP_ROLE_SIZE,
     .unit = "ohm",
     .meaning = "internal resistance of battery, leads and drive",
     .minimum = 0,
     .maximum = 100,
     .preset = 4},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->supply_resistance += value[0];
}

const effect_t effect_battery_sag = {
    .info = {.name = "battery_sag",
             .words = "a battery whose voltage sags under load",
             .summary = "The battery's voltage falls while the motors draw current, because battery and leads resist.",
             .mechanism = "supply",
             .acts_on = "supply",
             .equation = "V_supply = V_0 - resistance i_supply, with i_supply V_supply = sum of V_motor i; at least 1 "
                         "% of the nominal voltage",
             .source = "Shepherd 1965, Design of primary and secondary cells, the ohmic term",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every battery has an internal resistance, and cheap cells have a large one.",
             .advice = "Charge or replace the battery, shorten thin leads, and log the voltage at the drive.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(sag_t) / sizeof(real_t),
    .hook = {[SITE_START] = start, [SITE_SUPPLY] = supply, [SITE_DRIVE] = drive, [SITE_WHEEL] = wheel},
    .undo = undo,
};
