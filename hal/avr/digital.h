/* digital.h: an IMU on the I2C bus, MPU-6050 or LSM6DS, as BOARD_IMU says. With an analogue IMU the functions do
 * nothing.
 *
 * Each period has one transfer, which begins 1 ms before the tick. The first transfers ask the chip for its name and
 * set it up, one register per transfer. Later transfers read the data: 0.5 ms, 18 interrupts. The burst begins with the
 * chip's flag "data ready". So a chip that sleeps, or has lost its supply and its ranges, is not mistaken for a robot
 * at rest: the chip is set up again. A reading is stale after two ticks without a new reading.
 */
#ifndef BRICKPILOT_AVR_DIGITAL_H
#define BRICKPILOT_AVR_DIGITAL_H

#include <stdint.h>

void digital_start(void);

/* digital_begin() begins the period's transfer; digital_end() ends it at the tick. Both run in the clock's interrupt. A
 * transfer that has not ended by the tick is given up, and the bus is freed. */
void digital_begin(void);
void digital_end(void);

/* Number of transfers without an answer or an end, plus ticks without new data after the set-up; saturates at 65535. */
uint16_t digital_faults(void);

#endif
