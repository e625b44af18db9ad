#include "sensors/battery.h"

#include <math.h>

#include "models/rcx_gen.h"

battery_config_t battery_config_default(void)
{
    return (battery_config_t){.resolution = RCX_BATTERY_RESOLUTION};
}

double battery_read(const battery_config_t *config, double voltage)
{
    return voltage > 0 ? config->resolution * floor(voltage / config->resolution) : 0;
}
