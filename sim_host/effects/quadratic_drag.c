#include "effects/effect.h"

static void body(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->drag_surge += value[0] * real_abs(vehicle->middle.surge);
    vehicle->drag_sway += value[0] * real_abs(vehicle->middle.sway);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "drag",
     .role = BP_ROLE_SIZE,
     .unit = "N s^2/m^2",
     .meaning = "force at 1 m/s",
     .minimum = 0,
     .maximum = 1e5,
     .preset = 0.5},
};

const effect_t effect_quadratic_drag = {
    .info = {.name = "quadratic_drag",
             .words = "a drag that grows with the square of the speed",
             .summary = "A force against the motion grows with the square of the speed.",
             .mechanism = "body",
             .acts_on = "body",
             .equation = "X = -drag u |u|, Y = -drag v |v|, in addition to the air drag of eq. 5; of a motor: on its "
                         "load",
             .source = "Fossen 2011, Handbook of Marine Craft Hydrodynamics and Motion Control, quadratic damping; "
                       "eq. 5 (Worrall & McGookin 2006)",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Air drag is far below friction at the speed of a small robot.",
             .advice = "Look for what holds it back at speed, as a large front or soft ground.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body},
};
