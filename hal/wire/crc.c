#include "wire/crc.h"

#define POLYNOMIAL 0x1021U

static uint16_t byte_more(uint16_t crc, uint8_t byte)
{
    crc ^= (uint16_t)(byte << 8);
    for (uint8_t bits = 8; bits > 0; bits--)
        crc = (uint16_t)(crc << 1) ^ (crc & 0x8000U ? POLYNOMIAL : 0U);
    return crc;
}

uint16_t crc_of_bytes(uint16_t crc, const uint8_t *bytes, uint8_t size)
{
    for (; size > 0; size--)
        crc = byte_more(crc, *bytes++);
    return crc;
}

uint16_t crc_of_number(uint16_t crc, uint16_t number)
{
    return byte_more(byte_more(crc, (uint8_t)number), (uint8_t)(number >> 8));
}

uint16_t crc_of_message(const message_t *message)
{
    return crc_of_bytes(crc_of_number(CRC_START, message->id), message->data, CRC_AT);
}

void crc_seal(message_t *message)
{
    message_put(&message->data[CRC_AT], crc_of_message(message));
}

bool crc_holds(const message_t *message)
{
    return message->size == MESSAGE_DATA_MAX && message_get(&message->data[CRC_AT]) == crc_of_message(message);
}
