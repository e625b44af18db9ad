/* twi.h: the I2C bus, whose only master is this chip. A transfer runs by interrupts, one per byte, at 400 kHz.
 *
 * A device that was interrupted while it sent, for example by a reset of this chip, may hold the data line low and wait
 * for the clock. Then no transfer ends. twi_free() gives it nine clock pulses and a stop, and it releases the line.
 */
#ifndef BRICKPILOT_AVR_TWI_H
#define BRICKPILOT_AVR_TWI_H

#include <stdint.h>

enum { TWI_OUT = 2, TWI_IN = 16 };

typedef enum { TWI_DONE, TWI_BUSY, TWI_REFUSED } twi_state_t; /* refused: nobody answers to the address, or to a byte */

void twi_start(void);

/* Begins a transfer with the device at `address`, 7 bits: writes `out_size` bytes, 1..TWI_OUT, which are copied, then reads
 * `in_size` bytes, 0..TWI_IN. Call it only while no transfer is running. */
void twi_begin(uint8_t address, const uint8_t *out, uint8_t out_size, uint8_t in_size);

/* The state of the newest transfer. */
twi_state_t twi_state(void);

/* The TWI_IN bytes that the newest transfer has read: complete from its end until the next transfer begins. */
const uint8_t *twi_received(void);

/* Gives up the running transfer and frees the bus. Takes 0.1 ms. */
void twi_free(void);

#endif
