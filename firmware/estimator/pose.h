/* pose.h: dead reckoning, eq. 10 and 11, by the midpoint rule.
 *
 * The travel of a step has the direction of the heading half-way between two steps. The part below 1 um is carried over
 * to the next step. A reference overrides the position. Mirror the headings, and y is mirrored; turn the headings by
 * half a turn, and x and y are negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_POSE_H
#define BRICKPILOT_ESTIMATOR_POSE_H

#include "core/signals.h"

typedef struct {
    int32_t um;         /* +-2147 m, saturates */
    int16_t rest_um_q5; /* the part below 1 um, carried over to the next step */
} pose_axis_t;

/* All fields are 0 at the start; x.um, y.um and heading_bam16 may be the robot's pose instead. */
typedef struct {
    pose_axis_t x;
    pose_axis_t y;
    uint16_t heading_bam16; /* heading in the previous step */
} pose_state_t;

/* One step: adds the forward and the sideways travel of `estimate`, turned by its heading, and sets its x_um and y_um.
 * The error of the travel's length is below 1e-4 of this length plus 0.06 um. */
void pose_step(pose_state_t *state, const signals_sensors_t *sensors, signals_estimate_t *estimate);

#endif
