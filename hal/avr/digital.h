/* digital.h: an IMU on the I2C bus, MPU-6050 or LSM6DS, as BOARD_IMU says; with an analogue IMU these functions do nothing.
 *
 * Each period has one transfer, which begins 1 ms before the tick. The first transfers ask the chip for its name and
 * set it up, one register each. The later ones read it: 0.5 ms, 18 interrupts. The burst begins with the chip's own
 * "data ready", so that a sensor that sleeps, or has lost its supply and its ranges, is not taken for a sensor at rest:
 * it is set up again. A reading is stale after two ticks without a new reading.
 */
#ifndef BRICKPILOT_AVR_DIGITAL_H
#define BRICKPILOT_AVR_DIGITAL_H

#include <stdint.h>

void digital_start(void);

/* Begin the period's transfer, and end it at the tick; both run in the clock's interrupt. A transfer that has not ended
 * by the tick is given up, and the bus is freed. */
void digital_begin(void);
void digital_end(void);

/* Counts transfers without an answer or an end, and ticks without new data after the set-up; saturates at 65535. */
uint16_t digital_faults(void);

#endif
