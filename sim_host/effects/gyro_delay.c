#include "effects/delay_line.h"

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    double gyro[] = {vehicle->output[OUTPUT_YAW_RATE], vehicle->output[OUTPUT_YAW_ANGLE]};
    delay_signals(memory, gyro, 2, value[0], vehicle->step);
    vehicle->output[OUTPUT_YAW_RATE] = gyro[0];
    vehicle->output[OUTPUT_YAW_ANGLE] = gyro[1];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "delay",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "delay of yaw rate and yaw angle; until it is over the run's first values hold",
     .minimum = 0,
     .maximum = 0.3,
     .preset = 0.05},
};

const effect_t effect_gyro_delay = {
    .info = {.name = "gyro_delay",
             .words = "a delay of the gyro",
             .summary = "The gyro is logged some time after the other sensors.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .variant_of = "sensor_delay",
             .variation = "of the gyro alone",
             .equation = "y(t) = x(t - delay) for yaw_rate and yaw_angle, linear between body steps",
             .source = "dead time, Ljung 1999, System identification; a gyro on a bus of its own is read later",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Most boards sample the gyro in the same cycle as their other sensors.",
             .advice = "Shorten the gyro's filter, and stamp each reading with the time at which it was measured.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = DELAY_MEMORY(2),
    .hook = {[SITE_SENSOR] = sensor},
};
