/* battery.h: the brick's reading of its own supply. */
#ifndef BRICKPILOT_SENSORS_BATTERY_H
#define BRICKPILOT_SENSORS_BATTERY_H

typedef struct {
    double resolution; /* V, above 0 */
} battery_config_t;

/* The robot's, [sensors.battery] of models/rcx.toml. */
battery_config_t battery_config_default(void);

/* Reading in V of a true voltage: rounded down to the resolution, 0 for a negative one. */
double battery_read(const battery_config_t *config, double voltage);

#endif
