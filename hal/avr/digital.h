/* digital.h: an IMU on the I2C bus, MPU-6050 or LSM6DS, as BOARD_IMU says; with an analogue IMU these functions do nothing.
 *
 * One transfer a period, begun 1 ms before the tick: first those that ask the chip for its name and set it up, one register each, then
 * those that read it: 0.5 ms, 18 interrupts. The burst begins with the chip's own "data ready", so that a sensor that
 * sleeps, or has lost its supply and its ranges, is not mistaken for one at rest: it is set up again. A reading is
 * stale after two ticks without a new one.
 */
#ifndef BRICKPILOT_AVR_DIGITAL_H
#define BRICKPILOT_AVR_DIGITAL_H

#include <stdint.h>

void digital_start(void);

/* Begins the period's transfer, and ends it at the tick; both in the clock's interrupt. One that has not ended by then is given up, and
 * the bus is freed. */
void digital_begin(void);
void digital_end(void);

/* Transfers that nobody answered or that did not end, and ticks without new data once the sensor was set up; stays at 65535. */
uint16_t digital_faults(void);

#endif
