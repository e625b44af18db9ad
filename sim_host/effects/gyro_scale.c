#include "effects/effect.h"

typedef struct {
    real_t started;
    real_t heading; /* heading at the start, from which the angle counts, rad */
} origin_t;

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    origin_t *origin = (origin_t *)memory;
    origin->heading = choose(origin->started == 0, vehicle->output[OUTPUT_YAW_ANGLE], origin->heading);
    origin->started = real_of(1);
    vehicle->output[OUTPUT_YAW_RATE] += value[0] * vehicle->output[OUTPUT_YAW_RATE];
    vehicle->output[OUTPUT_YAW_ANGLE] += value[0] * (vehicle->output[OUTPUT_YAW_ANGLE] - origin->heading);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "error",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "relative error; above 0 the gyro reads too much",
     .minimum = -0.5,
     .maximum = 0.5,
     .preset = 0.1,
     .says = "the gyro reads {} too much",
     .says_below = "the gyro reads {} too little"},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->gyro_gain *= 1 + value[0];
}

const effect_t effect_gyro_scale = {
    .info = {.name = "gyro_scale",
             .words = "a gyro that reads too much or too little",
             .summary = "The gyro's reading is a constant factor off.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "yaw_rate = (1 + error) r; yaw_angle is its integral",
             .source = "scale-factor error, IEEE Std 1431-2004; Titterton & Weston 2004",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Cheap gyros have a scale-factor error, but many are trimmed in the factory.",
             .advice = "Turn the robot by a known angle, such as ten full turns, and correct the gyro's scale.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(origin_t) / sizeof(real_t),
    .hook = {[SITE_SENSOR] = sensor},
    .undo = undo,
};
