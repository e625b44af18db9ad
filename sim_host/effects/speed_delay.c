#include "effects/delay_line.h"

/* The speeds of a robot's wheels, or of a motor. */
static const int SPEEDS[] = {OUTPUT_WHEEL_SPEED_LEFT,
                             OUTPUT_WHEEL_SPEED_RIGHT,
                             OUTPUT_WHEEL_VELOCITY_LEFT,
                             OUTPUT_WHEEL_VELOCITY_RIGHT,
                             OUTPUT_SPEED,
                             OUTPUT_VELOCITY};
enum { SPEED_COUNT = sizeof SPEEDS / sizeof SPEEDS[0] };

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    double speed[SPEED_COUNT];
    for (int i = 0; i < SPEED_COUNT; i++)
        speed[i] = vehicle->output[SPEEDS[i]];
    delay_signals(memory, speed, SPEED_COUNT, value[0], vehicle->step);
    for (int i = 0; i < SPEED_COUNT; i++)
        vehicle->output[SPEEDS[i]] = speed[i];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "delay",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "delay of every measured speed and velocity; until it is over the run's first values hold",
     .minimum = 0,
     .maximum = 0.3,
     .preset = 0.05},
};

const effect_t effect_speed_delay = {
    .info = {.name = "speed_delay",
             .words = "a delay of the measured speeds",
             .summary = "The speeds of the wheels are logged some time after the angles.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .variant_of = "sensor_delay",
             .variation = "of the speeds alone",
             .equation = "y(t) = x(t - delay) for speeds and velocities of wheels or motor, linear between body steps",
             .source = "dead time, Ljung 1999, System identification; a speed from counts is the mean over a window, "
                       "which is half a window late",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "A speed from counts is the mean over a window, which is long on coarse encoders.",
             .advice = "Stamp each speed with the middle of the time over which it was counted.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = DELAY_MEMORY(SPEED_COUNT),
    .hook = {[SITE_SENSOR] = sensor},
};
