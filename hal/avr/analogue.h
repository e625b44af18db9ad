/* analogue.h: the A/D converter, which reads the battery, and also gyro and accelerometer if they are analogue.
 *
 * Every tick begins a burst of conversions, 2.5 ms long, with one interrupt for each conversion. A burst adds up
 * several readings of every sensor in turn, so that all means are for about the same time. At its end it measures the
 * chip's own 1.1 V: the result is wrong if the converter is stuck or has lost its reference. A reading is stale when
 * no good burst has ended for two ticks.
 */
#ifndef BRICKPILOT_AVR_ANALOGUE_H
#define BRICKPILOT_AVR_ANALOGUE_H

#include <avr/io.h>
#include <stdint.h>

#include "avr/board.h"

/* The sums of a burst, in this order. */
enum {
#if BOARD_IMU == BOARD_ANALOGUE
    ANALOGUE_GYRO,
#ifdef AVR_ACCELEROMETER
    ANALOGUE_SURGE,
    ANALOGUE_SWAY,
#endif
#endif
    ANALOGUE_BATTERY,
    ANALOGUE_BANDGAP,
    ANALOGUE_SUMS
};

/* Number of bursts that did not end, or measured the 1.1 V wrongly; saturates at 65535. */
uint16_t analogue_faults(void);

void analogue_start(void);

/* Begins a burst; called in the tick's interrupt. A previous burst that has not ended is given up. */
void analogue_begin(void);

#endif
