/* parameters.h: the settings that a host may read and write while the brick is on, by their numbers, as raw integers.
 *
 * hal/wire/settings.toml lists every setting with its format and range. Those that tune the controller may be written at any time;
 * those that describe the robot (the compensation) only while it does not drive.
 */
#ifndef BRICKPILOT_APP_PARAMETERS_H
#define BRICKPILOT_APP_PARAMETERS_H

#include "app/loop.h"
#include "core/flash.h"

typedef struct {
    loop_config_t config;           /* in force */
    int16_t travel_scale_q15;       /* correction of the travel per count; the only setting outside `config` */
    uint16_t believed_travel_um_q2; /* the constants' travel per count, without that */
} parameters_t;

typedef enum {
    PARAMETERS_OK = 0,
    PARAMETERS_UNKNOWN = 1, /* there is no setting of this number */
    PARAMETERS_RANGE = 2,   /* outside its range: nothing is changed */
    PARAMETERS_BUSY = 3     /* not while the robot drives: nothing is changed */
} parameters_status_t;

/* The constants of a profile, and no compensation. */
void parameters_start(parameters_t *parameters, const FLASH loop_config_t *constants);

/* The value in force; 0: there is no such setting. */
int32_t parameters_read(const parameters_t *parameters, uint8_t number);

/* Writes a setting. `running`: the robot drives. */
parameters_status_t parameters_write(parameters_t *parameters, uint8_t number, int32_t value, bool running);

/* Does what the PARAMETER_REQUEST of this data asks for, and puts the value in force into its place. The status is not put there. */
parameters_status_t parameters_take(parameters_t *parameters, bool running, uint8_t *data);

#endif
