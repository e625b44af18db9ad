/* encoder.h: how a rotation sensor reads the angle of a wheel. */
#ifndef BRICKPILOT_SENSORS_ENCODER_H
#define BRICKPILOT_SENSORS_ENCODER_H

#include <stdint.h>

typedef struct {
    double counts_per_turn; /* of the wheel, above 0 */
} encoder_config_t;

/* Returns the robot's values: [sensors.encoder] of models/rcx.toml. */
encoder_config_t encoder_config_default(void);

/* Returns the free-running count at this wheel angle (rad, unwrapped): forward positive, rounded towards minus
 * infinity. The HAL delivers its low 16 bits. */
int64_t encoder_read(const encoder_config_t *config, double wheel_angle);

#endif
