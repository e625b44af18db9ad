#include "contracts.h"
#include "wire/crc.h"

/* The CRC is any function of the bytes: crc.c proves the real CRC. */
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
    uint8_t byte, at;

    ASSUME(decoder.size <= sizeof decoder.bytes && at < sizeof decoder.bytes);
    const frame_decoder_t before = decoder;
    const frame_status_t status = frame_take(&decoder, byte, &message);
    ASSERT(decoder.size <= sizeof decoder.bytes);
    ASSERT(status != FRAME_MESSAGE || (message.id <= MESSAGE_ID_MAX && message.size <= MESSAGE_DATA_MAX));
    ASSERT(byte != 0 || (decoder.size == 0 && !decoder.overlong)); /* after a 0x00 the next frame is found */
    /* Any other byte is stored behind those before it, and changes nothing else. */
    ASSERT(byte == 0 || before.size == sizeof decoder.bytes ||
           (status == FRAME_MORE && decoder.size == before.size + 1 && decoder.overlong == before.overlong &&
            decoder.bytes[at] == (at == before.size ? byte : before.bytes[at])));
    END();
}

/* Proves that a message's frame is COBS of the bytes in frame.h, and that these bytes unwrap to the message.
 * exhaustive.c shows that COBS decodes to what it encoded. The loop takes the sizes in turn, since CBMC follows a known
 * size alone. */
void frame_round_trip(void)
{
    for (uint8_t data_size = 0; data_size <= MESSAGE_DATA_MAX; data_size++) {
        message_t sent, got;
        uint8_t raw[RAW_MAX], coded[FRAME_SIZE_MAX], bytes[FRAME_SIZE_MAX];
        uint8_t size = HEAD;

        ASSUME(sent.id <= MESSAGE_ID_MAX);
        sent.size = data_size;
        raw[0] = (uint8_t)sent.id;
        raw[1] = (uint8_t)(sent.id >> 8);
        raw[2] = data_size;
        for (uint8_t i = 0; i < data_size; i++)
            raw[size++] = sent.data[i];
        const uint16_t crc = open_crc(CRC_START, raw, size);
        raw[size++] = (uint8_t)crc;
        raw[size++] = (uint8_t)(crc >> 8);
        const uint8_t coded_size = cobs_encode(raw, size, coded);
        ASSERT(frame_encode(&sent, bytes) == coded_size + 1 && bytes[coded_size] == 0);
        for (uint8_t i = 0; i < coded_size; i++)
            ASSERT(bytes[i] == coded[i]);
        ASSERT(unwrap(raw, size, &got) && got.id == sent.id && got.size == sent.size);
        for (uint8_t i = 0; i < data_size; i++)
            ASSERT(got.data[i] == sent.data[i]);
    }
    END();
}
