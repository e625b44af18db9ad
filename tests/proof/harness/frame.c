#include "contracts.h"
#include "wire/crc.h"

/* The CRC is any function of the bytes: crc.c proves the real one. */
uint16_t __CPROVER_uninterpreted_crc(uint32_t, uint32_t, uint32_t, uint32_t);

static uint16_t open_crc(uint16_t crc, const uint8_t *bytes, uint8_t size)
{
    uint32_t words[3] = {0, 0, 0};
    (void)crc;
    ASSERT(size <= 11);
    for (uint8_t i = 0; i < 11; i++)
        words[i >> 2] = words[i >> 2] << 8 | (i < size ? bytes[i] : 0U);
    return __CPROVER_uninterpreted_crc(words[0], words[1], words[2], size);
}
#define crc_of_bytes open_crc
#include "wire/frame.c"

void frame_safe(void)
{
    frame_decoder_t decoder;
    message_t message;
    uint8_t byte;

    ASSUME(decoder.size <= sizeof decoder.bytes);
    const frame_status_t status = frame_take(&decoder, byte, &message);
    ASSERT(decoder.size <= sizeof decoder.bytes);
    ASSERT(status != FRAME_MESSAGE || (message.id <= MESSAGE_ID_MAX && message.size <= MESSAGE_DATA_MAX));
    ASSERT(byte != 0 || (decoder.size == 0 && !decoder.overlong)); /* after a 0x00 the next frame is found */
    END();
}

void frame_round_trip(void)
{
    frame_decoder_t decoder = {.size = 0, .overlong = false};
    message_t sent, got;
    uint8_t bytes[FRAME_SIZE_MAX];
    frame_status_t status = FRAME_BAD;

    ASSUME(sent.id <= MESSAGE_ID_MAX && sent.size <= MESSAGE_DATA_MAX);
    const uint8_t size = frame_encode(&sent, bytes);
    ASSERT(size >= 7 && size <= FRAME_SIZE_MAX);
    for (uint8_t i = 0; i < size; i++) {
        ASSERT((bytes[i] == 0) == (i + 1 == size));
        status = frame_take(&decoder, bytes[i], &got);
        ASSERT(i + 1 == size || status == FRAME_MORE);
    }
    ASSERT(status == FRAME_MESSAGE && got.id == sent.id && got.size == sent.size);
    for (uint8_t i = 0; i < MESSAGE_DATA_MAX; i++)
        ASSERT(i >= sent.size || got.data[i] == sent.data[i]);
    END();
}
