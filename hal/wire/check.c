#include "wire/check.h"

/* Eight steps of the division by the polynomial at once: what they take away depends on the upper byte alone, and is this byte, with its
 * upper half added to its lower, at each bit of the polynomial. */
uint16_t check_crc16(uint16_t crc, const uint8_t *bytes, uint8_t size)
{
    while (size-- > 0) {
        uint8_t upper = (uint8_t)(crc >> 8) ^ *bytes++;

        upper ^= upper >> 4;
        crc = (uint16_t)((crc << 8) ^ upper ^ ((uint16_t)upper << 5) ^ ((uint16_t)upper << 12));
    }
    return crc;
}

uint16_t check_of(const message_t *message)
{
    uint8_t id[2];
    message_put(id, message->id);
    return check_crc16(check_crc16(CHECK_START, id, sizeof id), message->data, CHECK_AT);
}

void check_seal(message_t *message)
{
    message_put(&message->data[CHECK_AT], check_of(message));
}

bool check_holds(const message_t *message)
{
    return message->size == MESSAGE_DATA_MAX && message_get(&message->data[CHECK_AT]) == check_of(message);
}
