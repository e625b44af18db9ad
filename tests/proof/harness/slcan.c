#include "contracts.h"
#include "wire/slcan.c"

void slcan_safe(void)
{
    slcan_decoder_t decoder;
    message_t message;
    uint8_t byte;

    ASSUME(decoder.size <= sizeof decoder.line);
    const bool open = decoder.open;
    const slcan_status_t status = slcan_take(&decoder, byte, &message);
    ASSERT(decoder.size <= sizeof decoder.line);
    ASSERT(status != SLCAN_MESSAGE || (open && message.id <= MESSAGE_ID_MAX && message.size <= MESSAGE_DATA_MAX));
    ASSERT(status != SLCAN_REPLY || decoder.reply_size <= SLCAN_REPLY_MAX);
    ASSERT(byte != '\r' || (decoder.size == 0 && !decoder.overlong)); /* after a \r the next line is found */
    END();
}

/* A byte of a line is stored behind those before it, and changes nothing else. */
void slcan_gathers(void)
{
    slcan_decoder_t decoder;
    message_t message;
    uint8_t byte, at;

    ASSUME(decoder.size < sizeof decoder.line && byte != '\r' && at < sizeof decoder.line);
    const slcan_decoder_t before = decoder;
    ASSERT(slcan_take(&decoder, byte, &message) == SLCAN_MORE && decoder.size == before.size + 1);
    ASSERT(decoder.line[at] == (at == before.size ? byte : before.line[at]));
    ASSERT(decoder.overlong == before.overlong && decoder.open == before.open);
    END();
}

/* A message's line, gathered as slcan_gathers() proves, gives that message. The loop takes the sizes in turn, since
 * CBMC follows a known size alone. */
void slcan_round_trip(void)
{
    for (uint8_t data_size = 0; data_size <= MESSAGE_DATA_MAX; data_size++) {
        slcan_decoder_t decoder = {.overlong = false, .open = true};
        message_t sent, got;
        uint8_t bytes[SLCAN_SIZE_MAX];

        ASSUME(sent.id <= MESSAGE_ID_MAX);
        sent.size = data_size;
        const uint8_t size = slcan_encode(&sent, bytes);
        ASSERT(size == 6 + 2 * data_size && bytes[size - 1] == '\r');
        for (uint8_t i = 0; i + 1 < size; i++) {
            ASSERT(bytes[i] != '\r');
            decoder.line[i] = bytes[i];
        }
        decoder.size = (uint8_t)(size - 1);
        ASSERT(slcan_take(&decoder, '\r', &got) == SLCAN_MESSAGE && got.id == sent.id && got.size == sent.size);
        for (uint8_t i = 0; i < data_size; i++)
            ASSERT(got.data[i] == sent.data[i]);
    }
    END();
}
