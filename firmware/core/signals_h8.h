/* signals_h8.h: where signals_state_t has its fields on the RCX, and what a build can have. For .S files and the C files beside them. */
#ifndef BRICKPILOT_CORE_SIGNALS_H8_H
#define BRICKPILOT_CORE_SIGNALS_H8_H

#define SIGNALS_X_UM 0
#define SIGNALS_Y_UM 4
#define SIGNALS_HEADING 8
#define SIGNALS_SPEED 10
#define SIGNALS_YAW_RATE 12
#define SIGNALS_ACCEL 14
#define SIGNALS_AT_REST 16
#define SIGNALS_HAVE_BITS 20
#define SIGNALS_PERIOD_MS 21
#define SIGNALS_ACCEL_SURGE 22
#define SIGNALS_ROTATION_LEFT 28
#define SIGNALS_ROTATION_RIGHT 30
#define SIGNALS_REFERENCE_X 34
#define SIGNALS_REFERENCE_Y 38
#define SIGNALS_REFERENCE_SPEED 44
#define SIGNALS_PREDICTED 48
#define SIGNALS_TRAVEL 50
#define SIGNALS_SWAY_TRAVEL 54

#define MOTION_SURGE 0
#define MOTION_SWAY 4

#ifdef H8_ASSEMBLY

/* The bits of `have`, as core/signals.h has them, and their places. */
#define SENSOR_GYRO 1
#define SENSOR_ACCELEROMETER 2
#define SENSOR_ROTATION 4
#define SENSOR_REFERENCE 8
#define SENSOR_BATTERY 16
#define ACCELEROMETER_PLACE 1
#define ROTATION_PLACE 2
#define REFERENCE_PLACE 3
#ifndef SENSORS_POSSIBLE
#define SENSORS_POSSIBLE 31
#endif

#else

#include "core/h8_layout.h"
#include "core/signals.h"

H8_LAYOUT(signals_state_t, x_um, SIGNALS_X_UM);
H8_LAYOUT(signals_state_t, y_um, SIGNALS_Y_UM);
H8_LAYOUT(signals_state_t, heading_bam16, SIGNALS_HEADING);
H8_LAYOUT(signals_state_t, speed_mm_s_q4, SIGNALS_SPEED);
H8_LAYOUT(signals_state_t, yaw_rate_mrad_s, SIGNALS_YAW_RATE);
H8_LAYOUT(signals_state_t, accel_mm_s2, SIGNALS_ACCEL);
H8_LAYOUT(signals_state_t, at_rest, SIGNALS_AT_REST);
H8_LAYOUT(signals_state_t, sensors.have, SIGNALS_HAVE_BITS);
H8_LAYOUT(signals_state_t, sensors.period_ms, SIGNALS_PERIOD_MS);
H8_LAYOUT(signals_state_t, sensors.accel_surge_mm_s2, SIGNALS_ACCEL_SURGE);
H8_LAYOUT(signals_state_t, sensors.rotation_left, SIGNALS_ROTATION_LEFT);
H8_LAYOUT(signals_state_t, sensors.rotation_right, SIGNALS_ROTATION_RIGHT);
H8_LAYOUT(signals_state_t, sensors.reference_x_um, SIGNALS_REFERENCE_X);
H8_LAYOUT(signals_state_t, sensors.reference_y_um, SIGNALS_REFERENCE_Y);
H8_LAYOUT(signals_state_t, sensors.reference_speed_mm_s_q4, SIGNALS_REFERENCE_SPEED);
H8_LAYOUT(signals_state_t, predicted, SIGNALS_PREDICTED);
H8_LAYOUT(signals_state_t, travel_um_q5, SIGNALS_TRAVEL);
H8_LAYOUT(signals_state_t, sway_travel_um_q5, SIGNALS_SWAY_TRAVEL);
H8_LAYOUT(signals_motion_t, surge_mm_s_q17, MOTION_SURGE);
H8_LAYOUT(signals_motion_t, sway_mm_s_q17, MOTION_SWAY);

#endif

#endif
