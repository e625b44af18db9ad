#include "effects/effect.h"

#include <math.h>

typedef struct {
    double open;      /* V of the battery without current */
    double given[2];  /* V at each motor that this effect passed on in the last motor step */
    double passed[2]; /* share of it that the effects after this one let through: a dead band takes some */
} sag_t;

static void supply(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)value;
    ((sag_t *)memory)->open = vehicle->supply;
}

/* The mean current over the step is linear in the voltage; plant/motor.c computes it in the same way, with the speed at
 * the start of the step. So the voltage at which battery and motors agree is exact, however long the step is beside L /
 * R. */
static void drive(const double *value, double *memory, vehicle_t *vehicle)
{
    sag_t *sag = (sag_t *)memory;
    double slope = 0, drawn = 0; /* the battery's current is drawn + slope V */
    double share[2] = {0};
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        if (isnan(vehicle->voltage[k]))
            continue;
        const motor_t *motor = &vehicle->motor[k];
        const double decay = motor->inductance > 0 ? vehicle->step * motor->resistance / motor->inductance : INFINITY;
        const double left = isinf(decay) ? 0 : decay > 0 ? -expm1(-decay) / decay : 1;
        const double gain = (1 - left) / motor->resistance;
        share[k] = vehicle->voltage[k] / vehicle->supply;
        const double at_motor = share[k] * sag->passed[k];
        slope += at_motor * at_motor * gain;
        drawn +=
            at_motor * (left * vehicle->state.current[k] - gain * motor->emf_constant * vehicle->state.wheel_speed[k]);
    }
    const double agreed = (sag->open - value[0] * drawn) / (1 + value[0] * slope);
    vehicle->supply = vehicle_supply_of(vehicle, agreed);
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        if (!isnan(vehicle->voltage[k]))
            vehicle->voltage[k] = share[k] * vehicle->supply;
        sag->given[k] = vehicle->voltage[k];
    }
}

/* Learns what the effects after this one let through. It goes half way each step, because the share that a dead band
 * lets through depends on the voltage. */
static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)value;
    sag_t *sag = (sag_t *)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const double ratio = vehicle->voltage[k] / sag->given[k];
        if (isfinite(ratio))
            sag->passed[k] += 0.5 * (ratio - sag->passed[k]);
    }
}

static void start(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)value;
    (void)vehicle;
    sag_t *sag = (sag_t *)memory;
    sag->passed[0] = sag->passed[1] = 1;
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
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(sag_t) / sizeof(double),
    .hook = {[SITE_START] = start, [SITE_SUPPLY] = supply, [SITE_DRIVE] = drive, [SITE_WHEEL] = wheel},
    .undo = undo,
};
