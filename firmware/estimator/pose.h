/* pose.h: dead reckoning, eq. 10 and 11, by the midpoint rule.
 *
 * The travel of a step points along the heading half-way between two steps. The part below 1 um is carried over to the
 * next step. A reference overrides the position. Mirror the headings, and y is mirrored; turn them by half a turn, and
 * x and y are negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_POSE_H
#define BRICKPILOT_ESTIMATOR_POSE_H

#include "core/signals.h"

typedef struct {
    int32_t um;         /* +-2147 m, saturates */
    int16_t rest_um_q5; /* the part below 1 um, carried over to the next step */
} pose_axis_t;

/* All fields are 0 at the start, or x.um, y.um and heading_bam16 set to the robot's pose. */
typedef struct {
    pose_axis_t x;
    pose_axis_t y;
    uint16_t heading_bam16; /* heading of the step before */
} pose_state_t;

/* One step: adds both travels of `estimate`, along its heading, and sets its x_um and y_um. The error of the travel's
 * length is below 1e-4 of it, and 0.06 um. */
void pose_step(pose_state_t *state, const signals_sensors_t *sensors, signals_estimate_t *estimate);

#endif
