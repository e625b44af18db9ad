/* board.h: the wiring of the robot, and the sign, zero and scale of each sensor. Edit it if your robot is wired differently.
 *
 * With -DRCX_ROTATION the robot has two rotation sensors and the gyro; without it, the three axes of the paper's IMU.
 */
#ifndef BRICKPILOT_RCX_BOARD_H
#define BRICKPILOT_RCX_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include <dsensor.h>

/* Motors: left on output A, right on output C. If a motor turns the wrong way, turn its plug by half a turn. */

/* An axis of a sensor on an input. The converter gives 10 bits: 1..1022 is a reading, 0 a short circuit, 1023 an open input.
 * The whole range must stay within 32767 mm/s^2 or mrad/s. */
typedef struct {
    uint16_t zero_raw;     /* the reading at rest, on level ground */
    uint8_t per_count;     /* mm/s^2 or mrad/s per count, the whole part */
    uint8_t per_count_256; /* ... and the 256ths */
    bool reversed;         /* true: larger readings mean backward, to the left or counter-clockwise */
} board_axis_t;

#define BOARD_GYRO_INPUT SENSOR_2
static const board_axis_t BOARD_GYRO = {512, 20, 115, false}; /* range: 600 degrees/s */

#ifdef RCX_ROTATION
/* 16 counts per turn, geared up 1:3 from the wheel. Forward counts up. */
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
static const board_axis_t BOARD_SURGE = {512, 38, 82, false}; /* range: 2 g */
static const board_axis_t BOARD_SWAY = {512, 38, 82, false};
#endif

#endif
