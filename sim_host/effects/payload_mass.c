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
    {"mass", "kg", "of what is loaded", 0, 1e5, 0.3, 0},
    {"forward", "m", "where it sits; not for a motor", -10, 10, 0.06, 0},
    {"right", "m", "where it sits; not for a motor", -10, 10, 0, 1},
};

const effect_t effect_payload_mass = {
    .info = {.name = "payload_mass",
             .acts_on = "body",
             .equation = "a point mass at (forward, right) of the axle's middle: m, J_z and the centre of mass are "
                         "those of both together; m adds to the rolling friction of eq. 13; of a motor: to its load",
             .source = "composition of rigid bodies, parallel axis theorem: Goldstein 2002, Classical Mechanics",
             .parameter_count = 3,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
};
