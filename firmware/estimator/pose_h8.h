/* pose_h8.h: where pose_state_t has its fields on the RCX: for pose_h8.S, and pose.c beside it. */
#ifndef BRICKPILOT_ESTIMATOR_POSE_H8_H
#define BRICKPILOT_ESTIMATOR_POSE_H8_H

#include "core/signals_h8.h"

#define POSE_X_REST 0
#define POSE_Y_REST 2
#define POSE_HEADING 4

#ifndef H8_ASSEMBLY

#include "estimator/pose.h"

H8_LAYOUT(pose_state_t, x_rest_um_q5, POSE_X_REST);
H8_LAYOUT(pose_state_t, y_rest_um_q5, POSE_Y_REST);
H8_LAYOUT(pose_state_t, heading_bam16, POSE_HEADING);

#endif

#endif
