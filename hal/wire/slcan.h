/* slcan.h: messages on a serial line in the ASCII protocol of CAN adapters (Lawicel). The decoder acts as the adapter.
 *
 *   tIIILDD..\r   a frame: id in three hexadecimal digits, size in one, data
 *   C, O, Sn      close, open, bit rate: the reply is \r. The bit rate has no effect
 *   V, N          version, serial number
 *
 * The reply to an empty line is \r. The reply to anything else, and to a frame while the adapter is closed, is a bell
 * character. Frames have no reply and no checksum, so the messages have a CRC of their own: crc.h.
 */
#ifndef BRICKPILOT_WIRE_SLCAN_H
#define BRICKPILOT_WIRE_SLCAN_H

#include <stdbool.h>

#include "wire/message.h"

enum { SLCAN_SIZE_MAX = 22, SLCAN_REPLY_MAX = 6 };

/* Writes the line of a message and returns its size, 6..SLCAN_SIZE_MAX. */
uint8_t slcan_encode(const message_t *message, uint8_t bytes[SLCAN_SIZE_MAX]);

/* All fields are 0 at the start: the adapter is closed. */
typedef struct {
    uint8_t line[SLCAN_SIZE_MAX - 1];
    uint8_t size;
    bool overlong;
    bool open; /* true: the adapter takes frames */
    uint8_t reply[SLCAN_REPLY_MAX];
    uint8_t reply_size;
} slcan_decoder_t;

typedef enum {
    SLCAN_MORE = 0,
    SLCAN_MESSAGE = 1, /* `message` is written */
    SLCAN_REPLY = 2    /* the caller has to send `reply` */
} slcan_status_t;

slcan_status_t slcan_take(slcan_decoder_t *decoder, uint8_t byte, message_t *message);

#endif
