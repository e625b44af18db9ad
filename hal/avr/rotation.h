/* rotation.h: two rotation sensors in quadrature. Every edge of both lines makes a pin-change interrupt and counts. */
#ifndef BRICKPILOT_AVR_ROTATION_H
#define BRICKPILOT_AVR_ROTATION_H

#include <stdint.h>

void rotation_start(void);

/* Number of times that both lines of a sensor changed at once: an edge was missed, or there was noise. The sensor then
 * counts nothing. Saturates at 65535. Most noise is not counted here: a false pulse on one line counts up and down.
 * If the other line has an edge within the pulse, the count loses 4 against the motion: not counted, either. */
uint16_t rotation_errors(void);

#endif
