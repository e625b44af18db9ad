#include "effects/effect.h"

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->output[OUTPUT_ACCEL_SURGE] += value[0];
    vehicle->output[OUTPUT_ACCEL_SWAY] += value[1];
}

static const bp_parameter_info PARAMETERS[] = {
    {"surge", "m/s^2", "of the forward accelerometer", -20, 20, 0.3, 0},
    {"sway", "m/s^2", "of the accelerometer to the right", -20, 20, 0.2, 1},
};

const effect_t effect_accel_bias = {
    .info = {.name = "accel_bias",
             .acts_on = "sensor",
             .equation = "accel_surge += surge, accel_sway += sway",
             .source = "fixed bias, Titterton & Weston 2004; on level ground a tilt of the mounting is g sin(tilt)",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_SENSOR] = sensor},
};
