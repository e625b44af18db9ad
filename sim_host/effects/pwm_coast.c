#include "effects/effect.h"

#include <math.h>
#include <stdbool.h>

/* Largest fraction of a tick, or of a sum, that is taken as a rounding error. */
static const double SLACK = 1e-9;

typedef struct {
    double sum;  /* sum of the ticks' duties so far; a tick in which it reaches 1 is a pulse */
    double on;   /* 1 during a pulse */
    double owed; /* pulse time in s that is still due: a motor step is all on or all off */
} density_t;

typedef struct {
    double into; /* s since the tick began */
    density_t density[2];
} pulses_t;

static double duty(const vehicle_t *vehicle, int k)
{
    const double part = fabs(vehicle->voltage[k]) / vehicle->supply;
    return part > 0 ? part : 0; /* a floating motor is NaN */
}

static void begin_tick(density_t *density, double part)
{
    density->sum += part < 1 ? part : 1;
    density->on = density->sum >= 1 - SLACK;
    density->sum -= density->on;
}

/* Adds the pulse time of the next motor step to `owed`. */
static void count_pulses(pulses_t *pulses, const vehicle_t *vehicle, double period)
{
    double left = vehicle->step;
    while (left > SLACK * period) {
        const double rest = period - pulses->into;
        const double span = left < rest ? left : rest;
        for (int k = 0; k < 2; k++) {
            if (pulses->into <= 0)
                begin_tick(&pulses->density[k], duty(vehicle, k));
            pulses->density[k].owed += pulses->density[k].on * span;
        }
        pulses->into = rest - span > SLACK * period ? pulses->into + span : 0;
        left -= span;
    }
}

static void drive(const double *value, double *memory, vehicle_t *vehicle)
{
    pulses_t *pulses = (pulses_t *)memory;
    const bool brakes = value[1] >= 0.5;
    count_pulses(pulses, vehicle, value[0]);
    for (int k = 0; k < 2; k++) {
        double *owed = &pulses->density[k].owed;
        const bool on = *owed > 0.5 * vehicle->step;
        if (isnan(vehicle->voltage[k]) || vehicle->voltage[k] == 0) {
            *owed = 0;
        } else if (on) {
            *owed -= vehicle->step;
            vehicle->voltage[k] = copysign(vehicle->supply, vehicle->voltage[k]);
        } else {
            vehicle->voltage[k] = brakes ? 0 : NAN;
        }
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "period",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "length of a tick, which is all pulse or all pause",
     .minimum = 1e-4,
     .maximum = 0.1,
     .preset = 0.001,
     .scan_from = 5e-4,
     .scan_to = 0.05,
     .scan_count = 24},
    {.name = "brakes",
     .role = BP_ROLE_SWITCH,
     .unit = "1",
     .meaning = "0: the motor floats in a pause; 1: it is shorted",
     .minimum = 0,
     .maximum = 1,
     .preset = 0},
};

const effect_t effect_pwm_coast = {
    .info = {.name = "pwm_coast",
             .words = "motors that float or brake between the drive's pulses",
             .summary = "The drive gives full voltage in pulses, and between them the motor floats or is shorted.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "each tick: sum += |V| / V_supply; where sum >= 1, sum -= 1 and V_motor = sign(V) V_supply "
                         "for the tick, otherwise the motor floats (i = 0) or is shorted; V = 0 is shorted",
             .source = "brickOS, kernel/dmotor.c, on its 1 ms system tick (CONF_DMOTOR_HOLD: shorted); first-order "
                       "sigma-delta modulation, Norsworthy, Schreier & Temes 1997",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Some bridges let the motor float between pulses, and others short it.",
             .advice = "Raise the PWM frequency, and look whether the driver floats or brakes between pulses.",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .motor_step = 0.001},
    .memory_count = sizeof(pulses_t) / sizeof(double),
    .hook = {[SITE_DRIVE] = drive},
};
