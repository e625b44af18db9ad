#include "effects/effect.h"

static void supply(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->supply = vehicle_supply_of(vehicle, vehicle->supply - value[0] * vehicle->state.age);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "rate",
     .role = BP_ROLE_SIZE,
     .unit = "V/s",
     .meaning = "voltage lost per second since power-on",
     .minimum = 0,
     .maximum = 100,
     .preset = 0.02},
};

const effect_t effect_battery_fade = {
    .info = {.name = "battery_fade",
             .words = "a battery that loses voltage as time passes",
             .summary = "The battery's voltage falls with the time since power-on, whatever the motors draw.",
             .mechanism = "supply",
             .acts_on = "supply",
             .equation = "V_supply = V_0 - rate t, t since power-on, over all runs; at least 1 % of the nominal "
                         "voltage",
             .source = "Shepherd 1965, Design of primary and secondary cells: discharge at a constant current, which "
                       "other loads than the motors may draw",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Time alone drains a battery only where other loads draw more than the motors.",
             .advice = "Charge the battery, look for what drains it beside the motors, and log its voltage.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "battery_discharge",
             .variation = "by time"},
    .hook = {[SITE_SUPPLY] = supply},
};
