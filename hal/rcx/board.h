/* board.h: what is plugged in where, and the scales of the sensors. A robot that is built otherwise is told here.
 *
 * -DRCX_ROTATION: two rotation sensors and the gyro; without it, the three axes of the IMU, as in the paper.
 */
#ifndef BRICKPILOT_RCX_BOARD_H
#define BRICKPILOT_RCX_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include <dsensor.h>

/* Motors: left on output A, right on output C. A motor that turns the wrong way has its plug turned by half a turn. */

/* An axis on an input, as the 10 bits of the converter: 1..1022. 0 and 1023 are a short and an open input. All of its range must
 * stay within 32767 mm/s^2 or mrad/s. */
typedef struct {
    uint16_t zero_raw;     /* at rest and level */
    uint8_t per_count;     /* mm/s^2 or mrad/s of one count, whole */
    uint8_t per_count_256; /* and 256ths */
    bool reversed;         /* larger values mean backward, to the left, counter-clockwise */
} board_axis_t;

#define BOARD_GYRO_INPUT SENSOR_2
static const board_axis_t BOARD_GYRO = {512, 20, 115, false}; /* 600 degrees/s at either end */

#ifdef RCX_ROTATION
/* 16 counts a turn, geared up 1:3 from the wheel; forward counts up. */
#define BOARD_LEFT_INPUT SENSOR_1
#define BOARD_LEFT_COUNT ROTATION_1
#define BOARD_RIGHT_INPUT SENSOR_3
#define BOARD_RIGHT_COUNT ROTATION_3
#define BOARD_COUNTING_INPUTS (1 << 2 | 1 << 0) /* brickOS has inputs 3, 2 and 1 in bits 0, 1 and 2 */
#define BOARD_LEFT_REVERSED false
#define BOARD_RIGHT_REVERSED false
#else
#define BOARD_SURGE_INPUT SENSOR_1
#define BOARD_SWAY_INPUT SENSOR_3
static const board_axis_t BOARD_SURGE = {512, 38, 82, false}; /* 2 g at either end */
static const board_axis_t BOARD_SWAY = {512, 38, 82, false};
#endif

#endif
