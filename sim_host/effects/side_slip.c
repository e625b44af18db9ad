#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->build.across = (tyre_t){.creep = value[0], .friction = value[1]};
}

static const bp_parameter_info PARAMETERS[] = {
    {"creep", "m/(N s)", "slip speed over force while that is small", 1e-4, 100, 0.3, 0},
    {"friction", "1", "largest force over load", 1e-3, 100, 0.8, 0},
};

const effect_t effect_side_slip = {
    .info = {.name = "side_slip",
             .acts_on = "wheel",
             .equation = "side force of both tyres Y = -v / sqrt(creep^2 + (v / (friction m g))^2), instead of v = 0. "
                         "coupled profile only; not for a motor",
             .source =
                 "linear creep, Johnson 1985, Contact Mechanics, ch. 8, up to Coulomb's limit; slip of wheeled robots: "
                 "Balakrishna & Ghosal 1995, IEEE Trans. Robotics and Automation 11(1). The smooth passage is ours",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
};
