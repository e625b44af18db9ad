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

#endif
