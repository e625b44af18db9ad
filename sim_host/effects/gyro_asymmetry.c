#include "effects/effect.h"

typedef struct {
    real_t started;
    real_t last;   /* true heading one step ago, rad */
    real_t turned; /* sum of the absolute changes of heading since the start, rad */
} turns_t;

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    turns_t *turns = (turns_t *)memory;
    const real_t heading = vehicle->state.heading;
    turns->turned += choose(turns->started == 0, real_of(0), real_abs(heading - turns->last));
    turns->last = heading;
    turns->started = real_of(1);
    const real_t half = 0.5 * value[0];
    vehicle->output[OUTPUT_YAW_RATE] += half * real_abs(vehicle->state.yaw_rate);
    vehicle->output[OUTPUT_YAW_ANGLE] += half * turns->turned;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "difference",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "gain of the gyro clockwise less counter-clockwise",
     .minimum = -1,
     .maximum = 1,
     .preset = 0.05,
     .odd = 1,
     .says = "the gyro reads {} more in turns to the right than in turns to the left"},
};

const effect_t effect_gyro_asymmetry = {
    .info = {.name = "gyro_asymmetry",
             .words = "a gyro whose gain differs by direction",
             .summary = "The gyro reads a turn to the right larger than the same turn to the left, or the reverse.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .variant_of = "gyro_scale",
             .variation = "by the direction of turning",
             .equation = "yaw_rate = r + difference / 2 |r|; yaw_angle is its integral",
             .source = "scale-factor asymmetry, IEEE Std 1431-2004; 363.4 and 362.8 degrees a turn, measured on a "
                       "LEGO hub by its makers",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Few cheap gyros differ by direction as much as they are off in both.",
             .advice = "Turn the robot by ten full turns each way, and give the gyro a scale for either direction.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(turns_t) / sizeof(real_t),
    .hook = {[SITE_SENSOR] = sensor},
};
