#include "effects/effect.h"

#include <math.h>

/* Part of the battery's voltage below which it does not fall. */
static const double FLOOR = 0.01;

/* A Newton step a body step on V = V_0 - resistance i(V), with the slope of both motors at full duty: the steady answer
 * is exact, and no resistance makes it swing for long. memory: V less V_0, of the last body step. */
static void supply(const double *value, double *memory, vehicle_t *vehicle)
{
    const int count = vehicle->vehicle == BP_MOTOR ? 1 : 2;
    double conductance = 0;
    for (int k = 0; k < count; k++)
        conductance += 1 / vehicle->motor[k].resistance;
    const double wanted = -value[0] * vehicle->supply_current;
    memory[0] += (wanted - memory[0]) / (1 + value[0] * conductance);
    memory[0] = fmax(memory[0], FLOOR * vehicle->parameter[PARAMETER_BATTERY_VOLTAGE] - vehicle->supply);
    vehicle->supply += memory[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {"resistance", "ohm", "internal resistance of the battery, leads and drive", 0, 100, 4, 0},
};

const effect_t effect_battery_sag = {
    .info = {.name = "battery_sag",
             .acts_on = "supply",
             .equation =
                 "V_supply = V_0 - resistance i_supply, with i_supply V_supply = sum of V_motor i; at least 1 % "
                 "of the nominal voltage",
             .source = "Shepherd 1965, Design of primary and secondary cells, the ohmic term",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = 1,
    .hook = {[SITE_SUPPLY] = supply},
};
