/* parameters.h: the settings that a host may read and write while the brick is on, by their number in
 * hal/wire/brickpilot.dbc, as raw integers in the firmware's formats.
 *
 * Gains, limits and guidance may be written at any time; what is known of the robot, from left_gain on, only when not in RUN.
 */
#ifndef BRICKPILOT_APP_PARAMETERS_H
#define BRICKPILOT_APP_PARAMETERS_H

#include "app/compensation.h"

typedef struct {
    loop_config_t config; /* in force, compensation included */
    compensation_t compensation;
    uint16_t believed_travel_um_q2; /* the constants' travel per count, without compensation */
} parameters_t;

typedef enum {
    PARAMETERS_OK = 0,
    PARAMETERS_UNKNOWN = 1,
    PARAMETERS_RANGE = 2, /* outside its range: nothing is changed */
    PARAMETERS_BUSY = 3   /* not now: nothing is changed */
} parameters_status_t;

/* The constants of a profile, and no compensation. */
void parameters_start(parameters_t *parameters, const loop_config_t *constants);

/* `value` is written only with PARAMETERS_OK. */
parameters_status_t parameters_read(const parameters_t *parameters, uint8_t index, int32_t *value);
parameters_status_t parameters_write(parameters_t *parameters, uint8_t index, int32_t value, bool running);

#endif
