/* message.h: one message of brickpilot.dbc. On every transport it has the content of a classic CAN frame. */
#ifndef BRICKPILOT_WIRE_MESSAGE_H
#define BRICKPILOT_WIRE_MESSAGE_H

#include <stdint.h>

enum { MESSAGE_ID_MAX = 0x7FF, MESSAGE_DATA_MAX = 8 };

typedef struct {
    uint16_t id;  /* 0..MESSAGE_ID_MAX */
    uint8_t size; /* 0..MESSAGE_DATA_MAX */
    uint8_t data[MESSAGE_DATA_MAX];
} message_t;

/* Byte order of this processor: the lowest byte of a number of `size` bytes is at index MESSAGE_LOWEST(size) in
 * memory, and the next byte MESSAGE_UP further. In a message the lowest byte comes first. */
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define MESSAGE_LOWEST(size) 0
#define MESSAGE_UP 1
#elif defined(__BYTE_ORDER__) || defined(__H8300__)
#define MESSAGE_LOWEST(size) ((size)-1)
#define MESSAGE_UP (-1)
#else
#error "the byte order of this processor is not known"
#endif

/* Copies a number of `size` bytes (1 or more) out of a message or into one. */
void message_move(void *to, const void *from, uint8_t size);

/* Read and write a number of 16 bits in a message. */
uint16_t message_get(const uint8_t *at);
void message_put(uint8_t *at, uint16_t value);

#endif
