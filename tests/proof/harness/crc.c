#include "contracts.h"
#include "wire/crc.c"
#define byte_more byte_more_by_bits
#define crc_of_bytes other_bytes
#define crc_of_number other_number
#define crc_of_message other_message
#define crc_seal other_seal
#define crc_holds other_holds
#define __H8300__
#include "../../../hal/wire/crc.c"
#undef __H8300__
#undef crc_seal
#undef crc_holds

/* Both forms, eight bits at a time and bit by bit (the polynomial's definition), for every CRC and byte. */
void crc_forms_agree(void)
{
    uint16_t crc;
    uint8_t byte;

#undef byte_more
    ASSERT(byte_more(crc, byte) == byte_more_by_bits(crc, byte));
    END();
}

void crc_sealed_holds(void)
{
    message_t message;

    message.size = MESSAGE_DATA_MAX;
    crc_seal(&message);
    ASSERT(crc_holds(&message));
    const uint8_t at = message.data[0];
    message.data[0] ^= 1;
    ASSERT(at == message.data[0] || !crc_holds(&message));
    END();
}

void crc_safe(void)
{
    message_t message;

    (void)crc_holds(&message);
    END();
}
