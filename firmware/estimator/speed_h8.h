/* speed_h8.h: where speed_config_t and speed_state_t have their fields on the RCX: for speed_h8.S, and speed.c beside it. */
#ifndef BRICKPILOT_ESTIMATOR_SPEED_H8_H
#define BRICKPILOT_ESTIMATOR_SPEED_H8_H

#include "core/signals_h8.h"

#define CONFIG_ACCEL_GAIN 0
#define CONFIG_SLOWEST_WEIGHT_BITS 2
#define CONFIG_COUNT_TRAVEL 4
#define CONFIG_COUNT_MISMATCH 6
#define CONFIG_BEHIND_TO_TRAVEL 8
#define CONFIG_BEHIND_TO_SPEED 10
#define CONFIG_ACCEL_FILTER 12

#define STATE_SPEED 0
#define STATE_ACCEL 4
#define STATE_BEHIND 8
#define STATE_BIAS 12
#define STATE_ROTATION_LEFT 18
#define STATE_ROTATION_RIGHT 20
#define STATE_SWAY 22
#define STATE_ROTATION_KNOWN 24

#ifndef H8_ASSEMBLY

#include "estimator/speed.h"

H8_LAYOUT(speed_config_t, accel_gain_q15, CONFIG_ACCEL_GAIN);
H8_LAYOUT(speed_config_t, slowest_weight_bits, CONFIG_SLOWEST_WEIGHT_BITS);
H8_LAYOUT(speed_config_t, count_travel_um_q2, CONFIG_COUNT_TRAVEL);
H8_LAYOUT(speed_config_t, count_mismatch_q15, CONFIG_COUNT_MISMATCH);
H8_LAYOUT(speed_config_t, behind_to_travel_q15, CONFIG_BEHIND_TO_TRAVEL);
H8_LAYOUT(speed_config_t, behind_to_speed_q15, CONFIG_BEHIND_TO_SPEED);
H8_LAYOUT(speed_config_t, accel_filter_q15, CONFIG_ACCEL_FILTER);
H8_LAYOUT(speed_state_t, speed_mm_s_q17, STATE_SPEED);
H8_LAYOUT(speed_state_t, accel_mm_s2_q8, STATE_ACCEL);
H8_LAYOUT(speed_state_t, behind_um_q5, STATE_BEHIND);
H8_LAYOUT(speed_state_t, bias.value, STATE_BIAS);
H8_LAYOUT(speed_state_t, rotation_left, STATE_ROTATION_LEFT);
H8_LAYOUT(speed_state_t, rotation_right, STATE_ROTATION_RIGHT);
H8_LAYOUT(speed_state_t, sway_mm_s_q4, STATE_SWAY);
H8_LAYOUT(speed_state_t, rotation_known, STATE_ROTATION_KNOWN);

#endif

#endif
