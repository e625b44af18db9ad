/* compensation.h: what is known of one robot beyond the model: the parameters that `brickpilot discover` writes.
 *
 * All zero changes nothing. Each stage undoes what belongs to it; the formats are explained there: mixer/drive.h,
 * estimator/heading.h, estimator/speed.h, app/step.h. A brick is told them one by one, by its settings: parameters.h.
 */
#ifndef BRICKPILOT_APP_COMPENSATION_H
#define BRICKPILOT_APP_COMPENSATION_H

#include "app/loop.h"

typedef struct {
    drive_config_t drive;
    bool battery_sags;
    int16_t gyro_bias_mrad_s;
    int16_t gyro_scale_q15;
    int16_t travel_scale_q15;   /* what the travel per count lacks, -32767..32767 = -1..1 of itself */
    int16_t count_mismatch_q15; /* left less right travel per count, over their sum */
} compensation_t;

/* Puts it into `config`, which holds the model's constants and none. For hosts: a brick's image is without it. */
void compensation_apply(const compensation_t *compensation, loop_config_t *config);

#endif
