#include "effects/effect.h"

#include <math.h>

static void body(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->drag_surge += value[0] * fabs(vehicle->middle.surge);
    vehicle->drag_sway += value[0] * fabs(vehicle->middle.sway);
}

static const bp_parameter_info PARAMETERS[] = {
    {"drag", "N s^2/m^2", "force at 1 m/s", 0, 1e5, 0.5, 0},
};

const effect_t effect_quadratic_drag = {
    .info = {.name = "quadratic_drag",
             .acts_on = "body",
             .equation = "X = -drag u |u|, Y = -drag v |v|, beside the air drag of eq. 5; of a motor: on its load",
             .source = "Fossen 2011, Handbook of Marine Craft Hydrodynamics and Motion Control, quadratic damping; eq. "
                       "5 (Worrall & McGookin 2006)",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body},
};
