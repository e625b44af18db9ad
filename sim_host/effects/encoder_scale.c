#include "effects/effect.h"

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int i = OUTPUT_WHEEL_SPEED_LEFT; i <= OUTPUT_WHEEL_VELOCITY_RIGHT; i++)
        vehicle->output[i] += value[0] * vehicle->output[i];
    for (int i = OUTPUT_SPEED; i <= OUTPUT_VELOCITY; i++)
        vehicle->output[i] += value[0] * vehicle->output[i];
}

static const bp_parameter_info PARAMETERS[] = {
    {"error", "1", "relative; above 0 the rotation sensors of both wheels say too much", -0.5, 0.5, 0.1, 0},
};

const effect_t effect_encoder_scale = {
    .info = {.name = "encoder_scale",
             .acts_on = "sensor",
             .equation = "reading = (1 + error) truth: angle, speed, travel and velocity of both wheels or of a motor",
             .source = "scaling error of odometry, Borenstein & Feng 1996; counts per turn taken wrongly",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_SENSOR] = sensor},
};
