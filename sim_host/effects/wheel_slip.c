#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->build.along = (tyre_t){.creep = value[0], .friction = value[1]};
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "creep",
     .role = BP_ROLE_SIZE,
     .unit = "m/(N s)",
     .meaning = "slip speed over force while the force is small",
     .minimum = 1e-4,
     .maximum = 100,
     .preset = 0.1},
    {.name = "friction",
     .role = BP_ROLE_SHAPE,
     .unit = "1",
     .meaning = "largest force over load",
     .minimum = 1e-3,
     .maximum = 100,
     .preset = 0.8},
};

const effect_t effect_wheel_slip = {
    .info = {.name = "wheel_slip",
             .words = "wheels that slip along the track",
             .summary = "The wheels turn faster than they roll when they push hard, and spin beyond a limit.",
             .mechanism = "tyre",
             .acts_on = "wheel",
             .equation = "force of each tyre along F = s / sqrt(creep^2 + (s / (friction m g / 2))^2), s = r_w w - (u "
                         "+- half_track r), instead of s = 0. coupled profile only; not for a motor",
             .source = "linear creep, Johnson 1985, Contact Mechanics, ch. 8, up to Coulomb's limit; slip of wheeled "
                       "robots: Balakrishna & Ghosal 1995, IEEE Trans. Robotics and Automation 11(1). The smooth "
                       "passage is ours",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Tyres slip along the track where a strong drive meets a smooth floor.",
             .advice = "Clean tyres and floor, and accelerate less hard.",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .motor_step = 0.003},
    .hook = {[SITE_BUILD] = build},
};
