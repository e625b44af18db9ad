/* clock.h: counts milliseconds with timer 2, and gives the control loop its ticks. */
#ifndef BRICKPILOT_AVR_CLOCK_H
#define BRICKPILOT_AVR_CLOCK_H

#include <stdint.h>

void clock_start(void);

/* Sleeps until a tick begins. Returns at once if a tick has begun since the last call returned. Call it with interrupts
 * on. Returns the number of ticks since the last call returned: 1, or more if the caller was late. */
uint8_t clock_wait(void);

#endif
