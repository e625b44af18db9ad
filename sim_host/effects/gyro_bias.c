#include "effects/effect.h"

/* memory: time since the run's start in s. */
static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    memory[0] += vehicle->step;
    vehicle->output[OUTPUT_YAW_RATE] += value[0];
    vehicle->output[OUTPUT_YAW_ANGLE] += value[0] * memory[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "bias",
     .role = BP_ROLE_SIZE,
     .unit = "rad/s",
     .meaning = "what the gyro reads at rest",
     .minimum = -10,
     .maximum = 10,
     .preset = 0.1,
     .odd = 1,
     .says = "the gyro at rest reads a turn of {} to the right"},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->gyro_offset += value[0];
}

const effect_t effect_gyro_bias = {
    .info = {.name = "gyro_bias",
             .words = "an offset of the gyro",
             .summary = "The gyro reads a constant turn while the vehicle stands still.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "yaw_rate = r + bias; yaw_angle is its integral from the run's start",
             .source = "fixed bias, IEEE Std 1431-2004; Titterton & Weston 2004",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every cheap gyro has a bias until somebody subtracts it.",
             .advice = "Average the gyro at rest before each run, and take that off.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .shapeless = 1},
    .memory_count = 1,
    .hook = {[SITE_SENSOR] = sensor},
    .undo = undo,
};
