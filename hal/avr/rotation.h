/* rotation.h: two rotation sensors in quadrature. Every edge of both lines makes a pin-change interrupt and counts. */
#ifndef BRICKPILOT_AVR_ROTATION_H
#define BRICKPILOT_AVR_ROTATION_H

#include <stdint.h>

void rotation_start(void);

/* Changes of both lines of a sensor at a time: at least one edge was missed, or it was noise. Nothing is counted then. Stays at 65535. */
uint16_t rotation_errors(void);

#endif
