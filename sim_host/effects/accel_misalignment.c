#include "effects/effect.h"

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const real_t surge = vehicle->output[OUTPUT_ACCEL_SURGE], sway = vehicle->output[OUTPUT_ACCEL_SWAY];
    real_t cosine, sine;
    real_turn(value[0], &cosine, &sine);
    vehicle->output[OUTPUT_ACCEL_SURGE] = cosine * surge + sine * sway;
    vehicle->output[OUTPUT_ACCEL_SWAY] = cosine * sway - sine * surge;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "angle",
     .role = BP_ROLE_SIZE,
     .unit = "rad",
     .meaning = "clockwise turn of the accelerometers about the vertical; a tilt on level ground is an accel_bias",
     .minimum = -0.8,
     .maximum = 0.8,
     .preset = 0.15,
     .odd = 1,
     .says = "the accelerometers are turned by {} to the right"},
};

const effect_t effect_accel_misalignment = {
    .info = {.name = "accel_misalignment",
             .words = "an accelerometer mounted askew",
             .summary = "The accelerometers are turned about the vertical, so each also reads a part of the other's "
                        "axis.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "accel_surge = cos(angle) a_u + sin(angle) a_v, accel_sway = cos(angle) a_v - sin(angle) a_u",
             .source = "mounting misalignment, Titterton & Weston 2004",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Boards are screwed along the chassis, so their yaw misalignment is small.",
             .advice = "Mount the accelerometers square to the robot, or turn their readings by this angle.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_SENSOR] = sensor},
};
