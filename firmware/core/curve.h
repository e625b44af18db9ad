/* curve.h: a curve of 257 values that never falls, in 194 bytes instead of 514. For trig.c, and for its form in assembly. */
#ifndef BRICKPILOT_CORE_CURVE_H
#define BRICKPILOT_CORE_CURVE_H

#include <stdint.h>

/* A chord joins every eighth value to the next one; its slope is rounded down. The bends say how far above the chord the
 * values 1 to 8 after the eighth lie; the first of two is in the high half of a byte. */
typedef struct {
    uint16_t every_8th[33];
    uint8_t bends[128];
} curve_t;

#endif
