#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->build.com_right += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "right",
     .role = BP_ROLE_SIZE,
     .unit = "m",
     .meaning = "distance to the right of the middle of the axle; negative: to the left",
     .minimum = -5,
     .maximum = 5,
     .preset = 0.02,
     .odd = 1,
     .says = "the centre of mass is {} to the right of the middle"},
};

const effect_t effect_com_lateral_offset = {
    .info = {.name = "com_lateral_offset",
             .words = "a centre of mass to the side of the middle",
             .summary = "The centre of mass is to the left or right of the vehicle's centre line.",
             .mechanism = "body",
             .acts_on = "body",
             .equation = "centre of mass `right` m to the right of the axle's middle, J_z about it as before: m (u' - "
                         "right r') = X, (J_z + m right^2) r' - m right u' = N. The IMU stays at the middle of the "
                         "axle, and the wheels' rolling friction does not change. paper profile: the thrust's lever. "
                         "Not for a motor",
             .source = "Fossen 2011, ch. 3, rigid body about a point other than the centre of mass",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Most chassis are symmetric, and batteries or arms on one side shift the centre of mass.",
             .advice = "Move the battery or another heavy part to the left.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
};
