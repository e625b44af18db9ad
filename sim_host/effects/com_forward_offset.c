#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->build.com_forward += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {"forward", "m", "of the middle of the axle; negative: behind", -5, 5, 0.03, 0},
};

const effect_t effect_com_forward_offset = {
    .info = {.name = "com_forward_offset",
             .acts_on = "body",
             .equation = "centre of mass `forward` m ahead of the axle, J_z about it as before: m u' - m forward r^2 = "
                         "X, (J_z + m forward^2) r' + m forward u r = N; the IMU stays at the middle of the axle, the "
                         "wheels' rolling friction as it is. paper profile: the thrust's lever. Not for a motor",
             .source = "Fossen 2011, ch. 3, rigid body about a point other than the centre of mass",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
};
