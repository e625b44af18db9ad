/* hal.h: the seam between the controller and whatever it runs on.
 *
 * Link-time substitution: a port (hal/sil, hal/link, later hal/rcx, ...) defines every function below; one that is
 * missing does not link. firmware/app/loop.c and serve.c are the only callers. No call blocks. All are called from one thread of
 * control.
 */
#ifndef BRICKPILOT_HAL_H
#define BRICKPILOT_HAL_H

#include <stdbool.h>
#include <stdint.h>

#include "wire/message.h"

typedef enum {
    HAL_OK = 0,
    HAL_ABSENT = 1, /* this port or this build-up has no such device */
    HAL_STALE = 2,  /* the device is there, but has no new valid value for this step */
    HAL_PARTLY = 3  /* hal_imu_read() alone: the yaw rate is OK, an accelerometer is absent */
} hal_status_t;

typedef struct {
    int16_t accel_surge_mm_s2; /* specific force forward, mm/s^2, -32767..32767; saturates */
    int16_t accel_sway_mm_s2;  /* to the right */
    int16_t yaw_rate_mrad_s;   /* clockwise from above, mrad/s, -32767..32767; saturates; bias not removed */
} hal_imu_t;

typedef struct {
    uint16_t left; /* counts since power-on, forward positive, wraps at 65536 */
    uint16_t right;
} hal_rotation_t;

/* The true state, where something outside the robot knows it. */
typedef struct {
    int32_t x_um; /* -2e9..2e9 */
    int32_t y_um;
    uint16_t heading_bam16;  /* 65536 = one turn, clockwise from above */
    int16_t speed_mm_s_q4;   /* surge, mm/s times 16; saturates */
    int16_t yaw_rate_mrad_s; /* saturates */
} hal_reference_t;

/* Milliseconds since power-on; wraps at 2^32. */
uint32_t hal_clock_ms(void);

/* Newest reading. Out is written only with HAL_OK; with HAL_PARTLY, its yaw rate. */
hal_status_t hal_imu_read(hal_imu_t *out);
hal_status_t hal_rotation_read(hal_rotation_t *out);
hal_status_t hal_reference_read(hal_reference_t *out);

/* Battery at the motor drive, mV, 0..20000. */
hal_status_t hal_battery_read(uint16_t *out_mv);

/* Motor duty, -32767..32767 = -1..1 times the battery voltage; forward positive. Takes effect at once and holds. */
void hal_motors_write(int16_t left_q15, int16_t right_q15);

/* Messages of hal/wire/brickpilot.dbc to and from whoever is at the other end of the link; how they travel is the port's
 * affair. False: no room, or none there. What a port read is whole, but messages may be missing or come twice. */
bool hal_link_write(const message_t *message);
bool hal_link_read(message_t *message);

#endif
