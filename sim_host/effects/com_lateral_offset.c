#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->build.com_right += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {"right", "m", "of the middle of the axle; negative: left", -5, 5, 0.02, 1},
};

const effect_t effect_com_lateral_offset = {
    .info = {.name = "com_lateral_offset",
             .acts_on = "body",
             .equation =
                 "centre of mass `right` m to the right of the axle's middle, J_z about it as before: m (u' - right "
                 "r') = X, (J_z + m right^2) r' - m right u' = N; the IMU stays at the middle of the axle, the wheels' "
                 "rolling friction as it is. paper profile: the thrust's lever. Not for a motor",
             .source = "Fossen 2011, ch. 3, rigid body about a point other than the centre of mass",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
};
