/* slcan.h: messages on a serial line as CAN adapters write them (Lawicel ASCII), seen from the adapter's end.
 *
 *   tIIILDD..\r   a frame: id in three hexadecimal digits, size in one, data
 *   C, O, Sn      close, open, bit rate: answered \r; the rate is of no consequence here
 *   V, N          version, serial number
 *
 * An empty line is answered \r, anything else, and a frame while closed, with a bell. Frames are not answered. There is no
 * check: hence check.h.
 */
#ifndef BRICKPILOT_WIRE_SLCAN_H
#define BRICKPILOT_WIRE_SLCAN_H

#include <stdbool.h>

#include "wire/message.h"

enum { SLCAN_SIZE_MAX = 22, SLCAN_REPLY_MAX = 6 };

/* Writes the line and returns its size, 6..SLCAN_SIZE_MAX. */
uint8_t slcan_encode(const message_t *message, uint8_t bytes[SLCAN_SIZE_MAX]);

/* All zero to begin with: closed. */
typedef struct {
    uint8_t line[SLCAN_SIZE_MAX - 1];
    uint8_t size;
    bool overlong;
    bool open; /* only then may frames be sent */
    uint8_t reply[SLCAN_REPLY_MAX];
    uint8_t reply_size;
} slcan_decoder_t;

typedef enum {
    SLCAN_MORE = 0,
    SLCAN_MESSAGE = 1, /* `message` is written */
    SLCAN_REPLY = 2    /* `reply` is to be sent */
} slcan_status_t;

slcan_status_t slcan_take(slcan_decoder_t *decoder, uint8_t byte, message_t *message);

#endif
