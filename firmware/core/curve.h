/* curve.h: a table of 257 values that never decrease, in 194 bytes instead of 514. trig.c and h8/trig.S use it. */
#ifndef BRICKPILOT_CORE_CURVE_H
#define BRICKPILOT_CORE_CURVE_H

#include <stdint.h>

/* A chord (a straight line) joins each value in `every_8th` to the next one; its slope is rounded down. `bends` has 4
 * bits for each of the 8 values after the start of a chord: how far the value lies above the chord. A byte holds two
 * such numbers, the first in its high half. */
typedef struct {
    uint16_t every_8th[33];
    uint8_t bends[128];
} curve_t;

#endif
