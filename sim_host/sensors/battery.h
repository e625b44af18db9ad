/* battery.h: how the brick reads the voltage of its own battery. */
#ifndef BRICKPILOT_SENSORS_BATTERY_H
#define BRICKPILOT_SENSORS_BATTERY_H

typedef struct {
    double resolution; /* V, above 0 */
} battery_config_t;

/* Returns the robot's values: [sensors.battery] of models/rcx.toml. */
battery_config_t battery_config_default(void);

/* Returns the reading of a true voltage, V: rounded down to the resolution; 0 for a negative voltage. */
double battery_read(const battery_config_t *config, double voltage);

#endif
