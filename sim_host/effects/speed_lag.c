#include "effects/effect.h"

#include <math.h>

/* The speeds of a robot's wheels, or of a motor. */
static const int SPEEDS[] = {OUTPUT_WHEEL_SPEED_LEFT,
                             OUTPUT_WHEEL_SPEED_RIGHT,
                             OUTPUT_WHEEL_VELOCITY_LEFT,
                             OUTPUT_WHEEL_VELOCITY_RIGHT,
                             OUTPUT_SPEED,
                             OUTPUT_VELOCITY};
enum { SPEED_COUNT = sizeof SPEEDS / sizeof SPEEDS[0] };

typedef struct {
    double started;
    double filtered[SPEED_COUNT], last[SPEED_COUNT]; /* readings behind the filter, and before it in the last step */
} filter_t;

/* Exact where a speed is linear in the step. */
static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    filter_t *filter = (filter_t *)memory;
    const double lag = value[0];
    const int settled = filter->started == 0 || lag <= 0;
    filter->started = 1;
    for (int i = 0; i < SPEED_COUNT; i++) {
        const double now = vehicle->output[SPEEDS[i]];
        if (settled) {
            filter->filtered[i] = now;
        } else {
            const double slope = lag * (now - filter->last[i]) / vehicle->step;
            const double behind = filter->filtered[i] - filter->last[i] + slope;
            filter->filtered[i] = now - slope + exp(-vehicle->step / lag) * behind;
        }
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
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(filter_t) / sizeof(double),
    .hook = {[SITE_SENSOR] = sensor},
};
