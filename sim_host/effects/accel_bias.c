#include "effects/effect.h"

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->output[OUTPUT_ACCEL_SURGE] += value[0];
    vehicle->output[OUTPUT_ACCEL_SWAY] += value[1];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "surge",
     .role = BP_ROLE_SIZE,
     .unit = "m/s^2",
     .meaning = "offset of the forward accelerometer",
     .minimum = -20,
     .maximum = 20,
     .preset = 0.3,
     .says = "the forward accelerometer reads {} too much",
     .says_below = "the forward accelerometer reads {} too little"},
    {.name = "sway",
     .role = BP_ROLE_SIZE,
     .unit = "m/s^2",
     .meaning = "offset of the accelerometer to the right",
     .minimum = -20,
     .maximum = 20,
     .preset = 0.2,
     .odd = 1,
     .says = "the sideways accelerometer reads {} too far to the right"},
};

const effect_t effect_accel_bias = {
    .info = {.name = "accel_bias",
             .words = "an offset of the accelerometers",
             .summary = "The accelerometers read a constant too much or too little.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "accel_surge += surge, accel_sway += sway",
             .source = "fixed bias, Titterton & Weston 2004; on level ground a tilt of the mounting is g sin(tilt)",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every cheap accelerometer has a zero offset, and every mounting tilts a little.",
             .advice = "Let it rest on level ground before each run, and take the mean of the accelerometers off.",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .shapeless = 1},
    .hook = {[SITE_SENSOR] = sensor},
};
