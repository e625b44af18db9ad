#include "wire/message.h"

void message_move(void *to, const void *from, uint8_t size)
{
    const uint8_t *read = (const uint8_t *)from + MESSAGE_LOWEST(size);
    uint8_t *at = (uint8_t *)to;

    do {
        *at++ = *read;
        read += MESSAGE_UP;
    } while (--size > 0);
}

uint16_t message_get(const uint8_t *at)
{
    return (uint16_t)(at[0] | (uint16_t)at[1] << 8);
}

void message_put(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}
