#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    build_t *b = &vehicle->build;
    const double forward = value[1] - b->com_forward, right = value[2] - b->com_right;
    const double total = b->mass + value[0];
    const double share = total > 0 ? value[0] / total : 0;
    b->yaw_inertia += share * b->mass * (forward * forward + right * right);
    b->com_forward += share * forward;
    b->com_right += share * right;
    b->mass = total;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "mass",
     .role = BP_ROLE_SIZE,
     .unit = "kg",
     .meaning = "mass of the load",
     .minimum = 0,
     .maximum = 1e5,
     .preset = 0.3},
    {.name = "forward",
     .role = BP_ROLE_PLACE,
     .unit = "m",
     .meaning = "where the load is, ahead of the axle; not for a motor",
     .minimum = -10,
     .maximum = 10,
     .preset = 0.06,
     .arm_of = "mass"},
    {.name = "right",
     .role = BP_ROLE_PLACE,
     .unit = "m",
     .meaning = "where the load is, to the right of the centre line; not for a motor",
     .minimum = -10,
     .maximum = 10,
     .preset = 0,
     .odd = 1,
     .optional = 1,
     .trial = 0.03,
     .arm_of = "mass"},
};

const effect_t effect_payload_mass = {
    .info = {.name = "payload_mass",
             .words = "a load that it carries",
             .summary = "The vehicle carries a load that the nominal mass does not contain.",
             .mechanism = "body",
             .acts_on = "body",
             .equation = "a point mass at (forward, right) from the axle's middle: m, J_z and the centre of mass are "
                         "those of vehicle and load together, and the rolling friction of eq. 13 grows with m. Of a "
                         "motor: it adds to the mass",
             .source = "composition of rigid bodies, parallel axis theorem: Goldstein 2002, Classical Mechanics",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Robots carry batteries, cameras or cargo that the stated mass leaves out.",
             .advice = "Weigh the robot as it drives and state its mass, or take the load off.",
             .parameter_count = 3,
             .parameters = PARAMETERS,
             .contains = "com_forward_offset com_lateral_offset"},
    .hook = {[SITE_BUILD] = build},
};
