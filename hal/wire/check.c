#include "wire/check.h"

uint16_t check_crc16(uint16_t crc, const uint8_t *bytes, uint8_t size)
{
    static const uint16_t OF_NIBBLE[16] = {0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7,
                                           0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C, 0xD1AD, 0xE1CE, 0xF1EF};
    for (uint8_t i = 0; i < size; i++) {
        crc = (uint16_t)((crc << 4) ^ OF_NIBBLE[(uint8_t)(crc >> 12) ^ (uint8_t)(bytes[i] >> 4)]);
        crc = (uint16_t)((crc << 4) ^ OF_NIBBLE[(uint8_t)(crc >> 12) ^ (uint8_t)(bytes[i] & 15U)]);
    }
    return crc;
}

uint16_t check_of(const message_t *message)
{
    uint8_t id[2];
    id[0] = (uint8_t)message->id;
    id[1] = (uint8_t)(message->id >> 8);
    return check_crc16(check_crc16(CHECK_START, id, 2), message->data, 6);
}

void check_seal(message_t *message)
{
    const uint16_t crc = check_of(message);
    message->data[6] = (uint8_t)crc;
    message->data[7] = (uint8_t)(crc >> 8);
}

bool check_holds(const message_t *message)
{
    const uint16_t crc = check_of(message);
    return message->size == 8 && message->data[6] == (uint8_t)crc && message->data[7] == (uint8_t)(crc >> 8);
}
