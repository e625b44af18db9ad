/* clock.h: milliseconds, and the ticks that the control loop follows, from timer 2. */
#ifndef BRICKPILOT_AVR_CLOCK_H
#define BRICKPILOT_AVR_CLOCK_H

#include <stdint.h>

void clock_start(void);

/* Sleeps until a tick begins. Returns at once if one has begun since the last return. Call it with interrupts on. Returns the ticks that
 * have begun since then: 1, or more if the caller was late. */
uint8_t clock_wait(void);

#endif
