/* frame.h: messages on a serial line.
 *
 *   id low, id high, size, data, CRC low, CRC high   at most 13 bytes; the CRC covers all bytes before it
 *   coded as COBS                                    one byte longer, without any 0x00
 *   0x00                                             ends the frame
 *
 * A reader that joins late, or reads a damaged frame, finds the next frame after the next 0x00. A sender may put a 0x00
 * before its first frame, to end an incomplete frame on the line.
 */
#ifndef BRICKPILOT_WIRE_FRAME_H
#define BRICKPILOT_WIRE_FRAME_H

#include <stdbool.h>

#include "wire/message.h"

enum { FRAME_SIZE_MAX = 15 };

/* Writes the frame of a message and returns its size, 7..FRAME_SIZE_MAX. */
uint8_t frame_encode(const message_t *message, uint8_t bytes[FRAME_SIZE_MAX]);

/* All fields are 0 at the start. */
typedef struct {
    uint8_t bytes[FRAME_SIZE_MAX - 1];
    uint8_t size;
    bool overlong;
} frame_decoder_t;

typedef enum {
    FRAME_MORE = 0,    /* no frame ends here */
    FRAME_MESSAGE = 1, /* `message` is written */
    FRAME_BAD = 2      /* a frame ends here that is too short, too long or damaged */
} frame_status_t;

/* Takes one byte of the line. Writes `message` only if it returns FRAME_MESSAGE. */
frame_status_t frame_take(frame_decoder_t *decoder, uint8_t byte, message_t *message);

#endif
