#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->build.across = (tyre_t){.creep = value[0], .friction = value[1]};
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "creep",
     .role = BP_ROLE_SIZE,
     .unit = "m/(N s)",
     .meaning = "slip speed over force while the force is small",
     .minimum = 1e-4,
     .maximum = 100,
     .preset = 0.3},
    {.name = "friction",
     .role = BP_ROLE_SHAPE,
     .unit = "1",
     .meaning = "largest force over load",
     .minimum = 1e-3,
     .maximum = 100,
     .preset = 0.8},
};

const effect_t effect_side_slip = {
    .info = {.name = "side_slip",
             .words = "wheels that slip sideways",
             .summary = "The vehicle slides sideways in curves.",
             .mechanism = "tyre",
             .acts_on = "wheel",
             .equation = "side force of both tyres Y = -v / sqrt(creep^2 + (v / (friction m g))^2), instead of v = 0. "
                         "coupled profile only; not for a motor",
             .source = "linear creep, Johnson 1985, Contact Mechanics, ch. 8, up to Coulomb's limit; slip of wheeled "
                       "robots: Balakrishna & Ghosal 1995, IEEE Trans. Robotics and Automation 11(1). The smooth "
                       "passage is ours",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Hard and narrow tyres slide in curves, and soft ones hold at low lateral acceleration.",
             .advice = "Clean tyres and floor, and turn less hard.",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .variant_of = "wheel_slip",
             .variation = "sideways"},
    .hook = {[SITE_BUILD] = build},
};
