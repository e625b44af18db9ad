/* hal.h: the controller's only interface to its hardware.
 *
 * A port (hal/sil, hal/link, hal/rcx, ...) defines every function below. A program that lacks one of them does not link.
 * Only firmware/app/loop.c, serve.c and the main programs in firmware/targets call these functions, always from the
 * same thread. No function blocks.
 */
#ifndef BRICKPILOT_HAL_H
#define BRICKPILOT_HAL_H

#include <stdbool.h>
#include <stdint.h>

#include "wire/message.h"

typedef enum {
    HAL_OK = 0,
    HAL_ABSENT = 1, /* this port, or this robot, has no such device */
    HAL_STALE = 2,  /* the device is there, but it has no new valid value for this step */
    HAL_PARTLY = 3  /* only from hal_imu_read(): the yaw rate is valid, an accelerometer is absent */
} hal_status_t;

typedef struct {
    int16_t accel_surge_mm_s2; /* specific force forward, mm/s^2, -32767..32767; saturates */
    int16_t accel_sway_mm_s2;  /* specific force to the right, same unit and range */
    int16_t yaw_rate_mrad_s;   /* clockwise from above, mrad/s, -32767..32767; saturates; bias not removed */
} hal_imu_t;

typedef struct {
    uint16_t left; /* counts since power-on, forward positive, wraps at 65536 */
    uint16_t right;
} hal_rotation_t;

/* The true state of the robot, if something outside the robot measures it. */
typedef struct {
    int32_t x_um; /* -2e9..2e9 */
    int32_t y_um;
    uint16_t heading_bam16;  /* 65536 = one turn, clockwise from above */
    int16_t speed_mm_s_q4;   /* surge, mm/s times 16; saturates */
    int16_t yaw_rate_mrad_s; /* saturates */
} hal_reference_t;

/* Milliseconds since power-on; wraps at 2^32. */
uint32_t hal_clock_ms(void);

/* These functions give the newest reading; a second call in the same step gives the same reading. They write `out` only
 * if they return HAL_OK; with HAL_PARTLY they write only its yaw rate. */
hal_status_t hal_imu_read(hal_imu_t *out);
hal_status_t hal_rotation_read(hal_rotation_t *out);
hal_status_t hal_reference_read(hal_reference_t *out);

/* Gives the battery's voltage at the motor drive in mV, 0..32000. */
hal_status_t hal_battery_read(uint16_t *out_mv);

/* Sets the duty of both motors: -32767..32767 is -1..1 times the battery's voltage, forward positive. It takes effect at
 * once and holds until the next call. */
void hal_motors_write(int16_t left_q15, int16_t right_q15);

/* Send and receive one message of hal/wire/brickpilot.dbc. The port decides how messages travel. Return false if there is
 * no room, or no message. hal_link_write() has room for eight messages in a step. A received message is undamaged, but
 * messages may be lost or come twice. */
bool hal_link_write(const message_t *message);
bool hal_link_read(message_t *message);

#endif
