#include "wire/crc.h"

#include "vectors.h"

enum { LONGEST = 32 };

void vectors_feed(void)
{
    static uint8_t bytes[LONGEST];
    static message_t message;
    const uint16_t drawn = draw_u16(), start = draw_u16(), size = draw_u16() & (LONGEST - 1U);

    bytes[drawn & (LONGEST - 1U)] = (uint8_t)(drawn >> 8);
    hash_u16(crc_of_bytes(start, bytes, (uint8_t)size));
    message.id = draw_up_to(MESSAGE_ID_MAX);
    message.size = draw_rarely(3) ? (uint8_t)draw_up_to(MESSAGE_DATA_MAX) : MESSAGE_DATA_MAX;
    message.data[drawn & 7U] = (uint8_t)(drawn >> 8);
    hash_u16(crc_of_message(&message));
    crc_seal(&message);
    if (draw_rarely(1))
        message.data[start & 7U] ^= (uint8_t)(start >> 8);
    hash_u8(crc_holds(&message));
    for (uint8_t i = 0; i < MESSAGE_DATA_MAX; i++)
        hash_u8(message.data[i]);
}
