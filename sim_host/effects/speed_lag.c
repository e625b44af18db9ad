#include "effects/effect.h"

/* The speeds of a robot's wheels, or of a motor. */
static const int SPEEDS[] = {OUTPUT_WHEEL_SPEED_LEFT,
                             OUTPUT_WHEEL_SPEED_RIGHT,
                             OUTPUT_WHEEL_VELOCITY_LEFT,
                             OUTPUT_WHEEL_VELOCITY_RIGHT,
                             OUTPUT_SPEED,
                             OUTPUT_VELOCITY};
enum { SPEED_COUNT = sizeof SPEEDS / sizeof SPEEDS[0] };

typedef struct {
    real_t started;
    real_t filtered[SPEED_COUNT], last[SPEED_COUNT]; /* last step's readings after and before the filter */
} filter_t;

/* Exact if a speed is linear in time within the step. */
static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    filter_t *filter = (filter_t *)memory;
    const real_t lag = value[0];
    const mask_t settled = (filter->started == 0) | (lag <= 0);
    const real_t kept = real_exp(-vehicle->step / lag);
    filter->started = real_of(1);
    for (int i = 0; i < SPEED_COUNT; i++) {
        const real_t now = vehicle->output[SPEEDS[i]];
        const real_t slope = lag * (now - filter->last[i]) / vehicle->step;
        const real_t behind = filter->filtered[i] - filter->last[i] + slope;
        filter->filtered[i] = choose(settled, now, now - slope + kept * behind);
        filter->last[i] = now;
        vehicle->output[SPEEDS[i]] = filter->filtered[i];
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "time_constant",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "time constant of every measured speed and velocity",
     .minimum = 0,
     .maximum = 10,
     .preset = 0.05},
};

const effect_t effect_speed_lag = {
    .info = {.name = "speed_lag",
             .words = "a lag of the measured speeds",
             .summary = "The logged speeds of the wheels follow the truth gradually, as behind a filter.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .variant_of = "sensor_delay",
             .variation = "gradual, and of the speeds alone",
             .equation = "time_constant y' + y = x for speeds and velocities of wheels or motor, settled at the start",
             .source = "first-order low-pass; discretised as in Astrom & Wittenmark 1997, Computer-controlled systems",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Many programs smooth a speed that they differentiate from counts.",
             .advice = "Shorten the filter of the measured speeds, or log the counts.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(filter_t) / sizeof(real_t),
    .hook = {[SITE_SENSOR] = sensor},
};
