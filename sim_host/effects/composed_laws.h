/* composed_laws.h: the sums of the terms of composed_term, one function for each place and way to act. */
#ifndef BRICKPILOT_EFFECTS_COMPOSED_LAWS_H
#define BRICKPILOT_EFFECTS_COMPOSED_LAWS_H

#include "effects/composed_basis.h"

#define COMPOSED_ONE(name, unit, low, odd, expression) +1

/* The parameters, in the order of the table. */
typedef struct {
    double drive_gain[COMPOSED_DRIVE_GAIN(COMPOSED_ONE)], drive_gain_diff[COMPOSED_DRIVE_GAIN(COMPOSED_ONE)];
    double drive_add[COMPOSED_DRIVE_ADD(COMPOSED_ONE)], drive_add_diff[COMPOSED_DRIVE_ADD(COMPOSED_ONE)];
    double wheel_loss[COMPOSED_WHEEL_LOSS(COMPOSED_ONE)], wheel_loss_diff[COMPOSED_WHEEL_LOSS(COMPOSED_ONE)];
    double wheel_dry[COMPOSED_WHEEL_DRY(COMPOSED_ONE)], wheel_dry_diff[COMPOSED_WHEEL_DRY(COMPOSED_ONE)];
    double wheel_gain[COMPOSED_WHEEL_GAIN(COMPOSED_ONE)], wheel_gain_diff[COMPOSED_WHEEL_GAIN(COMPOSED_ONE)];
    double wheel_push[COMPOSED_WHEEL_PUSH(COMPOSED_ONE)], wheel_push_diff[COMPOSED_WHEEL_PUSH(COMPOSED_ONE)];
    double surge_dry[COMPOSED_SURGE_DRY(COMPOSED_ONE)], surge_loss[COMPOSED_SURGE_LOSS(COMPOSED_ONE)];
    double surge_push[COMPOSED_SURGE_PUSH(COMPOSED_ONE)];
    double yaw_dry[COMPOSED_YAW_DRY(COMPOSED_ONE)], yaw_loss[COMPOSED_YAW_LOSS(COMPOSED_ONE)],
        yaw_push[COMPOSED_YAW_PUSH(COMPOSED_ONE)];
    double floor_add[COMPOSED_FLOOR_ADD(COMPOSED_ONE)];
    double encoder_gain[COMPOSED_ENCODER_GAIN(COMPOSED_ONE)], encoder_gain_diff[COMPOSED_ENCODER_GAIN(COMPOSED_ONE)];
    double gyro_add[COMPOSED_GYRO_ADD(COMPOSED_ONE)];
    double accel_surge_add[COMPOSED_ACCEL_SURGE_ADD(COMPOSED_ONE)],
        accel_sway_add[COMPOSED_ACCEL_SWAY_ADD(COMPOSED_ONE)];
    double frequency, order, wavelength, patch_x, patch_half_width, damping, clock;
} composed_t;

enum { COMPOSED_COUNT = sizeof(composed_t) / sizeof(double) };

/* The symbols of the expressions. Each place sets those that its terms use. */
typedef struct {
    double V, other, i, w, theta;
    double u, r, psi, x, y, patch, sprung;
    double a, b, i_left, i_right;
    double t;
} composed_point_t;

/* Sums the terms of one list with the coefficients c. A term with coefficient 0 is not evaluated, because its
 * expression may be infinite. */
typedef double composed_sum_t(const double *c, const composed_t *given, const composed_point_t *at);

composed_sum_t composed_drive_gain;
composed_sum_t composed_drive_add;
composed_sum_t composed_wheel_dry;
composed_sum_t composed_wheel_loss;
composed_sum_t composed_wheel_gain;
composed_sum_t composed_wheel_push;
composed_sum_t composed_surge_dry;
composed_sum_t composed_surge_loss;
composed_sum_t composed_surge_push;
composed_sum_t composed_yaw_dry;
composed_sum_t composed_yaw_loss;
composed_sum_t composed_yaw_push;
composed_sum_t composed_floor_add;
composed_sum_t composed_encoder_gain;
composed_sum_t composed_gyro_add;
composed_sum_t composed_accel_surge_add;
composed_sum_t composed_accel_sway_add;

#endif
