/* curve.h: a table of 257 values that never decrease, in 194 bytes instead of 514. For trig.c and h8/trig.S. */
#ifndef BRICKPILOT_CORE_CURVE_H
#define BRICKPILOT_CORE_CURVE_H

#include <stdint.h>

/* A chord, a straight line, joins each eighth value to the next eighth value; its slope is rounded down. `bends` says,
 * in 4 bits each, how far above the chord the values 1 to 8 after an eighth value lie. Of two values, the first one is
 * in the high half of a byte. */
typedef struct {
    uint16_t every_8th[33];
    uint8_t bends[128];
} curve_t;

#endif
