#include "effects/effect.h"

/* memory: time since the run's start in s. The drift begins at power-on, so it goes on from run to run. */
static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    memory[0] += vehicle->step;
    const real_t age = vehicle->state.age;
    vehicle->output[OUTPUT_YAW_RATE] += value[0] * age;
    vehicle->output[OUTPUT_YAW_ANGLE] += value[0] * memory[0] * (age - 0.5 * memory[0]);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "rate",
     .role = BP_ROLE_SIZE,
     .unit = "rad/s^2",
     .meaning = "growth of the offset, which is 0 at power-on",
     .minimum = -1,
     .maximum = 1,
     .preset = 0.02,
     .odd = 1,
     .says = "the gyro's offset grows by {} to the right"},
};

const effect_t effect_gyro_drift = {
    .info = {.name = "gyro_drift",
             .words = "an offset of the gyro that drifts",
             .summary = "The gyro's offset grows with the time since power-on.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "yaw_rate = r + rate t, t since power-on; yaw_angle is its integral from the run's start",
             .source = "rate ramp, IEEE Std 952-1997, annex C",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "The bias of a gyro drifts while its chip warms up, and settles after that.",
             .advice = "Let the gyro warm up, and take its offset off again at every stop.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "gyro_bias",
             .variation = "growing with time"},
    .memory_count = 1,
    .hook = {[SITE_SENSOR] = sensor},
};
