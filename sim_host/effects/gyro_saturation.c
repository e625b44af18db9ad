#include "effects/effect.h"

typedef struct {
    double missing; /* rad/s: what the last yaw rate lost */
    double angle;   /* rad: its integral */
} lost_t;

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    lost_t *lost = (lost_t *)memory;
    const double rate = vehicle->output[OUTPUT_YAW_RATE], limit = value[0];
    const double missing = rate > limit ? rate - limit : rate < -limit ? rate + limit : 0;
    lost->angle += 0.5 * vehicle->step * (lost->missing + missing);
    lost->missing = missing;
    vehicle->output[OUTPUT_YAW_RATE] -= missing;
    vehicle->output[OUTPUT_YAW_ANGLE] -= lost->angle;
}

static const bp_parameter_info PARAMETERS[] = {
    {"limit", "rad/s", "end of the gyro's range, both directions", 0.01, 1000, 3, 0},
};

const effect_t effect_gyro_saturation = {
    .info = {.name = "gyro_saturation",
             .acts_on = "sensor",
             .equation = "yaw_rate = r within -limit to limit, else the nearer end; yaw_angle is its integral",
             .source = "input range, IEEE Std 1431-2004; Titterton & Weston 2004",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(lost_t) / sizeof(double),
    .hook = {[SITE_SENSOR] = sensor},
};
