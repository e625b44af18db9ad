/* serial.h: bytes on UART 0, through a ring buffer in each direction. Interrupts move the bytes. */
#ifndef BRICKPILOT_AVR_SERIAL_H
#define BRICKPILOT_AVR_SERIAL_H

#include <stdbool.h>
#include <stdint.h>

/* Sizes of the buffers in bytes: powers of two, so that an index wraps with a mask. Up to 35 bytes come in a tick of 3
 * ms; a frame has at most 15 bytes, and eight frames can wait to be sent. One byte of each buffer stays empty. */
enum { SERIAL_IN = 64, SERIAL_OUT = 128 };

void serial_start(void);

/* Gives the oldest byte that has come. Returns false if there is none. */
bool serial_read(uint8_t *byte);

/* True if `size` bytes, 0..127, can be sent at once. */
bool serial_has_room(uint8_t size);

/* Sends `size` bytes. The caller has checked that there is room for them. */
void serial_write(const uint8_t *bytes, uint8_t size);

/* Number of bytes lost in the UART or for lack of room in the buffer; saturates at 65535. */
uint16_t serial_overruns(void);

#endif
