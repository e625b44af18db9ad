/* mailbox.h: how a test on an AVR chip moves the world round the chip. The test writes the mailbox, then a request into WORLD_REQUEST; the
 * world reads and writes the mailbox before the next instruction. Numbers have their lowest byte first, on both sides.
 */
#ifndef BRICKPILOT_TESTS_AVR_MAILBOX_H
#define BRICKPILOT_TESTS_AVR_MAILBOX_H

#include <stdint.h>

enum { MAILBOX_INPUTS = 4, MAILBOX_BYTES = 16 };

/* Requests.
 *
 *   SHOW     the inputs get `raw`, the digital IMUs `motion` and their supply, and the wheels turn to `counts` within the next ms
 *   MEASURE  the world measures the drives for 64 periods of the PWM, 4.1 ms; then `parts` holds what it found
 *   SEND     `size` of `bytes` travel to the chip
 *   RECEIVE  `bytes` get what the chip has sent, `size` at most; `size` becomes their number
 *   FAULT    chip_fault_t `fault` gets the value `size`
 *   TELL     `parts`: what the drives do now, as bridge_state_t; `bytes`: what they did just before the newest reset; `size`: bytes
 *            lost in the receiver; `resets` */
enum { WORLD_SHOW = 1, WORLD_MEASURE, WORLD_SEND, WORLD_RECEIVE, WORLD_FAULT, WORLD_TELL };

typedef struct {
    uint16_t raw[MAILBOX_INPUTS]; /* 1024ths of 5 V: gyro, acceleration forward, to the right, battery */
    int16_t motion[3];            /* mrad/s clockwise, mm/s^2 forward, to the right */
    uint16_t counts[2];           /* of the rotation sensors, left and right */
    int16_t parts[2];             /* 1024ths of full duty, left and right */
    uint8_t imu_unpowered;
    uint8_t fault;
    uint8_t resets;
    uint8_t size;
    uint8_t bytes[MAILBOX_BYTES];
} mailbox_t;

#endif
