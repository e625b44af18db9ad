/* parameters.h: the settings that a host may read and write while the brick is on, by their number in
 * hal/wire/brickpilot.dbc, as raw integers in the firmware's formats.
 *
 * Gains, limits and guidance may be written at any time; what is known of the robot, from left_gain on, only when not in RUN.
 */
#ifndef BRICKPILOT_APP_PARAMETERS_H
#define BRICKPILOT_APP_PARAMETERS_H

#include "app/loop.h"

typedef struct {
    loop_config_t config;           /* in force */
    int16_t travel_scale_q15;       /* of compensation.h; the only setting that is not as it stands in `config` */
    uint16_t believed_travel_um_q2; /* the constants' travel per count, without that */
} parameters_t;

typedef enum {
    PARAMETERS_OK = 0,
    PARAMETERS_UNKNOWN = 1,
    PARAMETERS_RANGE = 2, /* outside its range: nothing is changed */
    PARAMETERS_BUSY = 3   /* not now: nothing is changed */
} parameters_status_t;

/* The constants of a profile, and no compensation. */
void parameters_start(parameters_t *parameters, const loop_config_t *constants);

/* Does what the PARAMETER_REQUEST of this data asks for, and puts the value in force into its place: 0 with PARAMETERS_UNKNOWN. The status
 * is not put there. `running`: what is known of the robot is not to be written. */
parameters_status_t parameters_take(parameters_t *parameters, bool running, uint8_t *data);

/* The travel per count, in um_q2, that is `scale_q15` more than `believed`; saturates. */
uint16_t parameters_travel_um_q2(uint16_t believed, int16_t scale_q15);

#endif
