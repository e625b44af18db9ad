#include "effects/effect.h"

static void supply(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->supply = vehicle_supply_of(vehicle, vehicle->supply - value[0] * vehicle->state.charge);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "slope",
     .role = BP_ROLE_SIZE,
     .unit = "V/C",
     .meaning = "voltage lost per charge drawn since power-on",
     .minimum = 0,
     .maximum = 1000,
     .preset = 0.2},
};

const effect_t effect_battery_discharge = {
    .info = {.name = "battery_discharge",
             .words = "a battery that loses voltage as it is drained",
             .summary = "The battery's voltage falls with the charge that has been drawn since power-on.",
             .mechanism = "supply",
             .acts_on = "supply",
             .equation = "V_supply = V_0 - slope q, where q is the charge drawn since power-on, over all runs; at "
                         "least 1 % of the nominal voltage",
             .source = "Shepherd 1965, Design of primary and secondary cells, linear for small q",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "A battery loses voltage with its charge, but short runs draw little of it.",
             .advice = "Charge the battery, and log its voltage for the simulation.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .carries_over = 1},
    .hook = {[SITE_SUPPLY] = supply},
};
