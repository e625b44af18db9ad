/* pose.h: dead reckoning, eq. 10 and 11, by the midpoint rule.
 *
 * The travel of a step is laid along the heading half-way between two steps. What is below 1 um is carried on. A
 * reference overrides. Mirror the headings, and y is mirrored; turn by half a turn, and both axes are negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_POSE_H
#define BRICKPILOT_ESTIMATOR_POSE_H

#include "core/signals.h"

/* All zero to begin with at the origin, or with x_um, y_um and heading_bam16 set to where the robot stands. */
typedef struct {
    int32_t x_um; /* +-2147 m, saturates */
    int32_t y_um;
    int16_t x_rest_um_q5; /* carried, below 1 um */
    int16_t y_rest_um_q5;
    uint16_t heading_bam16; /* of the step before */
} pose_state_t;

typedef struct {
    const signals_sensors_t *sensors;
    int32_t travel_um_q5;      /* of speed_step(): forward, +-2^26 */
    int32_t sway_travel_um_q5; /* to the right */
    uint16_t heading_bam16;    /* of heading_step(): now */
} pose_input_t;

typedef struct {
    int32_t x_um;
    int32_t y_um;
} pose_output_t;

/* One step. Error of the travel's length below 1e-4, and 0.06 um. */
void pose_step(pose_state_t *state, const pose_input_t *input, pose_output_t *output);

#endif
