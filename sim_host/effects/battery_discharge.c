#include "effects/effect.h"

#include <math.h>

/* Part of the battery's voltage that is left when it is empty. */
static const double FLOOR = 0.01;

static void supply(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const double left = vehicle->supply - value[0] * vehicle->state.charge;
    vehicle->supply = fmax(left, FLOOR * vehicle->parameter[PARAMETER_BATTERY_VOLTAGE]);
}

static const bp_parameter_info PARAMETERS[] = {
    {"slope", "V/C", "voltage lost by charge drawn since power-on", 0, 1000, 0.2, 0},
};

const effect_t effect_battery_discharge = {
    .info = {.name = "battery_discharge",
             .acts_on = "supply",
             .equation =
                 "V_supply = V_0 - slope q, q = charge drawn since power-on, over all runs; at least 1 % of the "
                 "nominal voltage",
             .source = "Shepherd 1965, Design of primary and secondary cells, linear for small q",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_SUPPLY] = supply},
};
