/* rotation.h: two rotation sensors in quadrature. Every edge of both lines makes a pin-change interrupt and counts. */
#ifndef BRICKPILOT_AVR_ROTATION_H
#define BRICKPILOT_AVR_ROTATION_H

#include <stdint.h>

void rotation_start(void);

/* Changes of both lines of a sensor at a time: at least one edge was missed, or it was noise. Nothing is counted then. Stays at 65535.
 * Most noise is no error: a false pulse on one line counts forth and back. If the other line has an edge within the pulse, the count
 * loses 4 against the motion, and that is no error either. */
uint16_t rotation_errors(void);

#endif
