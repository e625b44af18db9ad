#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle == BP_MOTOR)
        return;
    vehicle->build.rim[0] *= 1 + 0.5 * value[0];
    vehicle->build.rim[1] *= 1 - 0.5 * value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {"mismatch", "1", "left radius less right radius, over their mean", -1, 1, 0.05, 1},
};

const effect_t effect_wheel_radius_mismatch = {
    .info = {.name = "wheel_radius_mismatch",
             .acts_on = "wheel",
             .equation =
                 "left wheel's radius r_w (1 + mismatch / 2), right wheel's r_w (1 - mismatch / 2); wheel_travel and "
                 "wheel_velocity stay those of r_w, which is what odometry assumes. Not for a motor",
             .source = "unequal wheel diameters: Borenstein & Feng 1996, Measurement and correction of systematic "
                       "odometry errors in mobile robots, IEEE Trans. Robotics and Automation 12(6)",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
};
