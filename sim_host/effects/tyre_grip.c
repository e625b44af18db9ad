#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->build.along = vehicle->build.across = (tyre_t){.creep = value[0], .friction = value[1]};
    vehicle->build.one_circle = 1;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "creep",
     .role = BP_ROLE_SIZE,
     .unit = "m/(N s)",
     .meaning = "slip speed over force of one tyre, in any direction, while the force is small",
     .minimum = 1e-4,
     .maximum = 100,
     .preset = 0.1},
    {.name = "friction",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "largest force over load, in any direction",
     .minimum = 1e-3,
     .maximum = 100,
     .preset = 0.8},
};

const effect_t effect_tyre_grip = {
    .info = {.name = "tyre_grip",
             .words = "tyres whose grip is one circle",
             .summary = "Each tyre bears so much force in any direction, so that one that pushes hard holds less "
                        "sideways.",
             .mechanism = "tyre",
             .acts_on = "wheel",
             .equation = "force of each tyre F = s / sqrt(creep^2 + (|s| / (friction m g / 2))^2), against its slip "
                         "over the floor s = (r_w w - (u +- half_track r), -v), instead of s = 0. Replaces wheel_slip "
                         "and side_slip. coupled profile only; not for a motor",
             .source = "Coulomb's cone and linear creep within it: Pacejka 2012, Tire and Vehicle Dynamics, ch. 3, "
                       "combined slip of an isotropic tyre; Johnson 1985, Contact Mechanics, ch. 8. The smooth passage "
                       "is ours",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "A friction circle shows only near the limit of grip in both directions at once.",
             .advice = "Clean tyres and floor, and accelerate and turn less hard than the grip allows.",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .motor_step = 0.003,
             .variant_of = "wheel_slip",
             .variation = "as one circle"},
    .hook = {[SITE_BUILD] = build},
};
