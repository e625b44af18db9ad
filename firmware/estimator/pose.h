/* pose.h: dead reckoning, eq. 10 and 11, by the midpoint rule.
 *
 * The travel of a step is laid along the heading half-way between two steps. What is below 1 um is carried on. A
 * reference overrides. Mirror the headings, and y is mirrored; turn by half a turn, and both axes are negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_POSE_H
#define BRICKPILOT_ESTIMATOR_POSE_H

#include "core/signals.h"

/* All zero to begin with, or with heading_bam16 set to where the robot points. */
typedef struct {
    int16_t x_rest_um_q5; /* carried, below 1 um */
    int16_t y_rest_um_q5;
    uint16_t heading_bam16; /* of the step before */
} pose_state_t;

/* One step: moves x and y on by both travels. Error of the travel's length below 1e-4, and 0.06 um. */
void pose_step(pose_state_t *state, signals_state_t *signals);

#endif
