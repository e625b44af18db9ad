#include "effects/effect.h"

typedef struct {
    real_t started;
    real_t surge, sway, yaw_rate; /* filtered, at the end of the last step */
    real_t mean_surge, mean_sway; /* filtered, as means over the last step, like accelerometer readings */
    real_t turning;               /* unfiltered yaw rate of the last step */
    real_t first;                 /* yaw rate at the start, when the filter is in its steady state */
} filter_t;

/* Exact if the accelerations are constant in the step, as means are, and the yaw rate is linear in time. */
static void advance(filter_t *filter, const real_t *output, real_t lag, real_t step)
{
    const real_t kept = real_exp(-step / lag), mean_kept = -lag / step * real_expm1(-step / lag);
    const real_t slope = lag * (output[OUTPUT_YAW_RATE] - filter->turning) / step;
    const real_t surge = output[OUTPUT_ACCEL_SURGE], sway = output[OUTPUT_ACCEL_SWAY];
    filter->mean_surge = surge + mean_kept * (filter->surge - surge);
    filter->mean_sway = sway + mean_kept * (filter->sway - sway);
    filter->surge = surge + kept * (filter->surge - surge);
    filter->sway = sway + kept * (filter->sway - sway);
    filter->yaw_rate = output[OUTPUT_YAW_RATE] - slope + kept * (filter->yaw_rate - filter->turning + slope);
}

/* Sets the filter to its steady state in the lanes of `settled`. */
static void settle(filter_t *filter, const real_t *output, mask_t settled)
{
    const real_t surge = output[OUTPUT_ACCEL_SURGE], sway = output[OUTPUT_ACCEL_SWAY];
    const real_t yaw_rate = output[OUTPUT_YAW_RATE];
    filter->surge = choose(settled, surge, filter->surge);
    filter->mean_surge = choose(settled, surge, filter->mean_surge);
    filter->sway = choose(settled, sway, filter->sway);
    filter->mean_sway = choose(settled, sway, filter->mean_sway);
    filter->yaw_rate = choose(settled, yaw_rate, filter->yaw_rate);
    filter->first = choose(settled, yaw_rate, filter->first);
}

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    filter_t *filter = (filter_t *)memory;
    real_t *output = vehicle->output;
    const mask_t settled = (filter->started == 0) | (value[0] <= 0);
    filter->started = real_of(1);
    if (!all_lanes(settled))
        advance(filter, output, value[0], vehicle->step);
    settle(filter, output, settled);
    filter->turning = output[OUTPUT_YAW_RATE];
    output[OUTPUT_ACCEL_SURGE] = filter->mean_surge;
    output[OUTPUT_ACCEL_SWAY] = filter->mean_sway;
    output[OUTPUT_YAW_RATE] = filter->yaw_rate;
    output[OUTPUT_YAW_ANGLE] -= value[0] * (filter->yaw_rate - filter->first);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "time_constant",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "time constant of accelerometers and gyro alike",
     .minimum = 0,
     .maximum = 10,
     .preset = 0.05},
};

const effect_t effect_imu_lag = {
    .info = {.name = "imu_lag",
             .words = "a lag of the inertial sensors",
             .summary = "The readings of accelerometers and gyro follow the truth gradually, as behind a filter.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "time_constant y' + y = x for accel_surge, accel_sway and yaw_rate, settled at the start; "
                         "accelerations are read as means of y over a sample; yaw_angle is the integral of y",
             .source = "first-order low-pass; discretised as in Astrom & Wittenmark 1997, Computer-controlled systems",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Most inertial sensors have a low-pass filter, whose bandwidth is often above what shows.",
             .advice = "Shorten the filter of the inertial sensors.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(filter_t) / sizeof(real_t),
    .hook = {[SITE_SENSOR] = sensor},
};
