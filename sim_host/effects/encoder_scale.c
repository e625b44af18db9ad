#include "effects/effect.h"

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int i = OUTPUT_WHEEL_SPEED_LEFT; i <= OUTPUT_WHEEL_VELOCITY_RIGHT; i++)
        vehicle->output[i] += value[0] * vehicle->output[i];
    for (int i = OUTPUT_SPEED; i <= OUTPUT_VELOCITY; i++)
        vehicle->output[i] += value[0] * vehicle->output[i];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "error",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "relative error; above 0 the rotation sensors of both wheels read too much",
     .minimum = -0.5,
     .maximum = 0.5,
     .preset = 0.1,
     .says = "the rotation sensors read {} too much",
     .says_below = "the rotation sensors read {} too little"},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->travel_gain *= 1 + value[0];
}

const effect_t effect_encoder_scale = {
    .info = {.name = "encoder_scale",
             .words = "rotation sensors that read too much or too little",
             .summary = "The rotation sensors' readings are a constant factor off.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "reading = (1 + error) truth: angle, speed, travel and velocity of both wheels or of a motor",
             .source = "scaling error of odometry, Borenstein & Feng 1996; counts per turn taken wrongly",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Counts per turn are often stated for another gear ratio or edge count.",
             .advice = "Roll the robot over a measured way, and correct the counts of a turn or the wheel radius.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_SENSOR] = sensor},
    .undo = undo,
};
