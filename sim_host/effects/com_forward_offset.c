#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->build.com_forward += value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "forward",
     .role = BP_ROLE_SIZE,
     .unit = "m",
     .meaning = "distance ahead of the middle of the axle; negative: behind",
     .minimum = -5,
     .maximum = 5,
     .preset = 0.03,
     .says = "the centre of mass is {} ahead of the axle",
     .says_below = "the centre of mass is {} behind the axle"},
};

const effect_t effect_com_forward_offset = {
    .info = {.name = "com_forward_offset",
             .words = "a centre of mass ahead of or behind the axle",
             .summary = "The centre of mass is not above the axle.",
             .mechanism = "body",
             .acts_on = "body",
             .equation = "centre of mass `forward` m ahead of the axle, J_z about it as before: m u' - m forward r^2 "
                         "= X, (J_z + m forward^2) r' + m forward u r = N. The IMU stays at the middle of the axle, "
                         "and the wheels' rolling friction does not change. paper profile: the thrust's lever. Not "
                         "for a motor",
             .source = "Fossen 2011, ch. 3, rigid body about a point other than the centre of mass",
             .prior = BP_PRIOR_COMMON,
             .prior_reason =
                 "A robot with two wheels and a caster tips over unless its centre of mass is off the axle.",
             .advice = "Weigh the robot at axle and caster and state where its mass sits, or move the battery.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
};
