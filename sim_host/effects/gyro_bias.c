#include "effects/effect.h"

/* memory: s since the run's start. */
static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    memory[0] += vehicle->step;
    vehicle->output[OUTPUT_YAW_RATE] += value[0];
    vehicle->output[OUTPUT_YAW_ANGLE] += value[0] * memory[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {"bias", "rad/s", "what the gyro says at rest", -10, 10, 0.1, 1},
};

const effect_t effect_gyro_bias = {
    .info = {.name = "gyro_bias",
             .acts_on = "sensor",
             .equation = "yaw_rate = r + bias; yaw_angle is its integral from the run's start",
             .source = "fixed bias, IEEE Std 1431-2004; Titterton & Weston 2004",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = 1,
    .hook = {[SITE_SENSOR] = sensor},
};
