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
    END();
}

void slcan_round_trip(void)
{
    slcan_decoder_t decoder = {.size = 0, .overlong = false, .open = true};
    message_t sent, got;
    uint8_t bytes[SLCAN_SIZE_MAX];
    slcan_status_t status = SLCAN_REPLY;

    ASSUME(sent.id <= MESSAGE_ID_MAX && sent.size <= MESSAGE_DATA_MAX);
    const uint8_t size = slcan_encode(&sent, bytes);
    ASSERT(size >= 6 && size <= SLCAN_SIZE_MAX);
    for (uint8_t i = 0; i < size; i++)
        status = slcan_take(&decoder, bytes[i], &got);
    ASSERT(status == SLCAN_MESSAGE && got.id == sent.id && got.size == sent.size);
    for (uint8_t i = 0; i < MESSAGE_DATA_MAX; i++)
        ASSERT(i >= sent.size || got.data[i] == sent.data[i]);
    END();
}
