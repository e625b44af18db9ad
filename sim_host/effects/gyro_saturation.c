#include "effects/effect.h"

typedef struct {
    real_t missing; /* the part of the last yaw rate that was cut off, rad/s */
    real_t angle;   /* rad: the integral of `missing` */
} lost_t;

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    lost_t *lost = (lost_t *)memory;
    const real_t rate = vehicle->output[OUTPUT_YAW_RATE], limit = value[0];
    const real_t missing = choose(rate > limit, rate - limit, choose(rate < -limit, rate + limit, real_of(0)));
    lost->angle += 0.5 * vehicle->step * (lost->missing + missing);
    lost->missing = missing;
    vehicle->output[OUTPUT_YAW_RATE] -= missing;
    vehicle->output[OUTPUT_YAW_ANGLE] -= lost->angle;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "limit",
     .role = BP_ROLE_LIMIT,
     .unit = "rad/s",
     .meaning = "end of the gyro's range, in both directions",
     .minimum = 0.01,
     .maximum = 1000,
     .preset = 3,
     .limits = "yaw_rate"},
};

const effect_t effect_gyro_saturation = {
    .info = {.name = "gyro_saturation",
             .words = "a gyro that meets the end of its range",
             .summary = "The gyro does not read turns that are faster than its range.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "yaw_rate = r within -limit to limit, else the nearer end; yaw_angle is its integral",
             .source = "input range, IEEE Std 1431-2004; Titterton & Weston 2004",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Most gyros have a range that is far beyond the yaw rates of a robot.",
             .advice = "Choose a larger range of the gyro, or turn more slowly.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(lost_t) / sizeof(real_t),
    .hook = {[SITE_SENSOR] = sensor},
};
