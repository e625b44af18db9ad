/* composed_rows.h: the rows of the coefficients of composed_term, one macro for each place and way to act.
 *
 * A meaning reads TARGET += FACTORS [expression] FACTORS: the tools that compose terms parse it.
 */
#ifndef BRICKPILOT_EFFECTS_COMPOSED_ROWS_H
#define BRICKPILOT_EFFECTS_COMPOSED_ROWS_H

#include "effects/composed_basis.h"

#define ROW(row_name, row_unit, law, lowest, highest, is_odd)                                                          \
    {.name = row_name,                                                                                                 \
     .role = BP_ROLE_SIZE,                                                                                             \
     .unit = row_unit,                                                                                                 \
     .meaning = law,                                                                                                   \
     .minimum = lowest,                                                                                                \
     .maximum = highest,                                                                                               \
     .odd = is_odd},
#define ROW_DRIVE_GAIN(name, unit, low, odd, expression)                                                               \
    ROW("drive_gain_" #name, unit, "V += c * [" #expression "] * V", low * 100.0, 100, odd)
#define ROW_DRIVE_GAIN_DIFF(name, unit, low, odd, expression)                                                          \
    ROW("drive_gain_diff_" #name, unit, "V += side * c * [" #expression "] * V", low * 100.0, 100, 1)
#define ROW_DRIVE_ADD(name, unit, low, odd, expression)                                                                \
    ROW("drive_add_" #name, unit, "V += c * [" #expression "]", low * 100.0, 100, odd)
#define ROW_DRIVE_ADD_DIFF(name, unit, low, odd, expression)                                                           \
    ROW("drive_add_diff_" #name, unit, "V += side * c * [" #expression "]", low * 100.0, 100, 1)
#define ROW_WHEEL_LOSS(name, unit, low, odd, expression)                                                               \
    ROW("wheel_loss_" #name, unit, "T += -c * [" #expression "] * w", low * 1000.0, 1000, odd)
#define ROW_WHEEL_LOSS_DIFF(name, unit, low, odd, expression)                                                          \
    ROW("wheel_loss_diff_" #name, unit, "T += -side * c * [" #expression "] * w", low * 1000.0, 1000, 1)
#define ROW_WHEEL_DRY(name, unit, low, odd, expression)                                                                \
    ROW("wheel_dry_" #name, unit, "T += -c * [" #expression "] * sign(w)", low * 1000.0, 1000, odd)
#define ROW_WHEEL_DRY_DIFF(name, unit, low, odd, expression)                                                           \
    ROW("wheel_dry_diff_" #name, unit, "T += -side * c * [" #expression "] * sign(w)", low * 1000.0, 1000, 1)
#define ROW_WHEEL_GAIN(name, unit, low, odd, expression)                                                               \
    ROW("wheel_gain_" #name, unit, "T += c * [" #expression "] * K_t * i", low * 100.0, 100, odd)
#define ROW_WHEEL_GAIN_DIFF(name, unit, low, odd, expression)                                                          \
    ROW("wheel_gain_diff_" #name, unit, "T += side * c * [" #expression "] * K_t * i", low * 100.0, 100, 1)
#define ROW_WHEEL_PUSH(name, unit, low, odd, expression)                                                               \
    ROW("wheel_push_" #name, unit, "T += c * [" #expression "]", low * 1000.0, 1000, odd)
#define ROW_WHEEL_PUSH_DIFF(name, unit, low, odd, expression)                                                          \
    ROW("wheel_push_diff_" #name, unit, "T += side * c * [" #expression "]", -1000, 1000, 1)
#define ROW_SURGE_DRY(name, unit, low, odd, expression)                                                                \
    ROW("surge_dry_" #name, unit, "X += -c * [" #expression "] * sign(u)", low * 1e5, 1e5, odd)
#define ROW_SURGE_LOSS(name, unit, low, odd, expression)                                                               \
    ROW("surge_loss_" #name, unit, "X += -c * [" #expression "] * u", low * 1e5, 1e5, odd)
#define ROW_SURGE_PUSH(name, unit, low, odd, expression)                                                               \
    ROW("surge_push_" #name, unit, "X += c * [" #expression "]", low * 1e5, 1e5, odd)
#define ROW_YAW_DRY(name, unit, low, odd, expression)                                                                  \
    ROW("yaw_dry_" #name, unit, "N += -c * [" #expression "] * sign(r)", low * 1e4, 1e4, odd)
#define ROW_YAW_LOSS(name, unit, low, odd, expression)                                                                 \
    ROW("yaw_loss_" #name, unit, "N += -c * [" #expression "] * r", low * 1e4, 1e4, odd)
#define ROW_YAW_PUSH(name, unit, low, odd, expression)                                                                 \
    ROW("yaw_push_" #name, unit, "N += c * [" #expression "]", low * 1e4, 1e4, odd)
#define ROW_FLOOR_ADD(name, unit, low, odd, expression)                                                                \
    ROW("floor_add_" #name, unit, "slope += c * [" #expression "]", low * 0.7, 0.7, odd)
#define ROW_ENCODER_GAIN(name, unit, low, odd, expression)                                                             \
    ROW("encoder_gain_" #name, unit, "wheel_speed += c * [" #expression "] * w", low * 100.0, 100, odd)
#define ROW_ENCODER_GAIN_DIFF(name, unit, low, odd, expression)                                                        \
    ROW("encoder_gain_diff_" #name, unit, "wheel_speed += side * c * [" #expression "] * w", low * 100.0, 100, 1)
#define ROW_GYRO_ADD(name, unit, low, odd, expression)                                                                 \
    ROW("gyro_add_" #name, unit, "yaw_rate += c * [" #expression "]", low * 100.0, 100, odd)
#define ROW_ACCEL_SURGE_ADD(name, unit, low, odd, expression)                                                          \
    ROW("accel_surge_add_" #name, unit, "accel_surge += c * [" #expression "]", low * 1000.0, 1000, odd)
#define ROW_ACCEL_SWAY_ADD(name, unit, low, odd, expression)                                                           \
    ROW("accel_sway_add_" #name, unit, "accel_sway += c * [" #expression "]", low * 1000.0, 1000, odd)

#endif
