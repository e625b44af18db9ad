/* message.h: one message of brickpilot.dbc as it travels: a classic CAN frame, whatever carries it. */
#ifndef BRICKPILOT_WIRE_MESSAGE_H
#define BRICKPILOT_WIRE_MESSAGE_H

#include <stdint.h>

enum { MESSAGE_ID_MAX = 0x7FF, MESSAGE_DATA_MAX = 8 };

typedef struct {
    uint16_t id;  /* 0..MESSAGE_ID_MAX */
    uint8_t size; /* 0..MESSAGE_DATA_MAX */
    uint8_t data[MESSAGE_DATA_MAX];
} message_t;

/* A number of `size` bytes has its lowest one at MESSAGE_LOWEST(size) in memory, and the next one MESSAGE_UP further. In a message
 * numbers go up from their first byte. */
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define MESSAGE_LOWEST(size) 0
#define MESSAGE_UP 1
#elif defined(__BYTE_ORDER__) || defined(__H8300__)
#define MESSAGE_LOWEST(size) ((size)-1)
#define MESSAGE_UP (-1)
#else
#error "the order of a number's bytes is not known"
#endif

/* A number of `size` bytes, 1.., out of a message, or into one. */
void message_move(void *to, const void *from, uint8_t size);

/* One of 16 bits. */
uint16_t message_get(const uint8_t *at);
void message_put(uint8_t *at, uint16_t value);

#endif
