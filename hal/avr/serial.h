/* serial.h: bytes on UART 0, through a ring buffer in each direction. Interrupts move them. */
#ifndef BRICKPILOT_AVR_SERIAL_H
#define BRICKPILOT_AVR_SERIAL_H

#include <stdbool.h>
#include <stdint.h>

/* Powers of two, so that an index wraps with a mask. In a tick of 3 ms 35 bytes come; a frame has 15 at most, and eight of them can
 * wait to be sent. One byte of each buffer stays empty. */
enum { SERIAL_IN = 64, SERIAL_OUT = 128 };

void serial_start(void);

/* Gives the oldest byte that has come. Returns false if there is none. */
bool serial_read(uint8_t *byte);

/* Whether so many bytes can be sent at once, 0..127. */
bool serial_has_room(uint8_t size);

/* Sends bytes for which there is room. */
void serial_write(const uint8_t *bytes, uint8_t size);

/* Bytes that were lost, in the UART or for want of room in the buffer; stays at 65535. */
uint16_t serial_overruns(void);

#endif
