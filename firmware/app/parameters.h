/* parameters.h: the settings that a host may read and write while the brick is on. A setting has a number and a raw
 * integer as its value.
 *
 * hal/wire/settings.toml lists every setting with its format and range. Settings that tune the controller may be
 * written at any time; settings that describe the robot (the compensation) only while the robot does not drive.
 */
#ifndef BRICKPILOT_APP_PARAMETERS_H
#define BRICKPILOT_APP_PARAMETERS_H

#include "app/loop.h"
#include "core/flash.h"

typedef struct {
    loop_config_t config;           /* the configuration in force */
    int16_t travel_scale_q15;       /* correction of the travel per count; the only setting outside `config` */
    uint16_t believed_travel_um_q2; /* travel per count in the profile's constants, without travel_scale_q15 */
} parameters_t;

typedef enum {
    PARAMETERS_OK = 0,
    PARAMETERS_UNKNOWN = 1, /* there is no setting of this number */
    PARAMETERS_RANGE = 2,   /* the value is outside its range: nothing is changed */
    PARAMETERS_BUSY = 3     /* the setting must not change while the robot drives: nothing is changed */
} parameters_status_t;

/* Sets the constants of a profile, and sets the compensation to none. */
void parameters_start(parameters_t *parameters, const FLASH loop_config_t *constants);

/* Returns the value in force, or 0 if there is no such setting. */
int32_t parameters_read(const parameters_t *parameters, uint8_t number);

/* Writes a setting. `running`: true while the robot drives. */
parameters_status_t parameters_write(parameters_t *parameters, uint8_t number, int32_t value, bool running);

/* Carries out the PARAMETER_REQUEST in `data`, and writes the value in force into the value field of `data`. Returns
 * the status, which it does not write into `data`. */
parameters_status_t parameters_take(parameters_t *parameters, bool running, uint8_t *data);

#endif
