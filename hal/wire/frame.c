#include "wire/frame.h"

#include "wire/crc.h"

enum { HEAD = 3, TAIL = 2, RAW_MAX = HEAD + MESSAGE_DATA_MAX + TAIL };

static uint8_t cobs_encode(const uint8_t *raw, uint8_t size, uint8_t *bytes)
{
    uint8_t code_at = 0, at = 1;
    for (uint8_t i = 0; i < size; i++) {
        if (raw[i] == 0) {
            bytes[code_at] = (uint8_t)(at - code_at);
            code_at = at++;
        } else {
            bytes[at++] = raw[i];
        }
    }
    bytes[code_at] = (uint8_t)(at - code_at);
    return at;
}

/* Returns the number of decoded bytes; 0 if they are not valid COBS. No frame is long enough for a full block of
 * 254. */
static uint8_t cobs_decode(const uint8_t *bytes, uint8_t size, uint8_t raw[RAW_MAX])
{
    uint8_t made = 0, at = 0;
    while (at < size) {
        const uint8_t left = (uint8_t)(size - at);
        if (bytes[at] > left)
            return 0;
        const uint8_t end = (uint8_t)(at + bytes[at]);
        for (at++; at < end; at++)
            raw[made++] = bytes[at];
        if (at < size)
            raw[made++] = 0;
    }
    return made;
}

uint8_t frame_encode(const message_t *message, uint8_t bytes[FRAME_SIZE_MAX])
{
    uint8_t raw[RAW_MAX];
    uint8_t size = HEAD;
    uint16_t crc;

    raw[0] = (uint8_t)message->id;
    raw[1] = (uint8_t)(message->id >> 8);
    raw[2] = message->size;
    for (uint8_t i = 0; i < message->size; i++)
        raw[size++] = message->data[i];
    crc = crc_of_bytes(CRC_START, raw, size);
    raw[size++] = (uint8_t)crc;
    raw[size++] = (uint8_t)(crc >> 8);
    size = cobs_encode(raw, size, bytes);
    bytes[size++] = 0;
    return size;
}

static bool unwrap(const uint8_t *raw, uint8_t size, message_t *message)
{
    uint16_t crc;

    if (size < HEAD + TAIL || raw[2] > MESSAGE_DATA_MAX || raw[2] != size - HEAD - TAIL || raw[1] > 7)
        return false;
    crc = crc_of_bytes(CRC_START, raw, (uint8_t)(size - TAIL));
    if (raw[size - 2] != (uint8_t)crc || raw[size - 1] != (uint8_t)(crc >> 8))
        return false;
    message->id = (uint16_t)(raw[0] | (uint16_t)((uint16_t)raw[1] << 8));
    message->size = raw[2];
    for (uint8_t i = 0; i < message->size; i++)
        message->data[i] = raw[HEAD + i];
    return true;
}

frame_status_t frame_take(frame_decoder_t *decoder, uint8_t byte, message_t *message)
{
    uint8_t raw[RAW_MAX];
    uint8_t size;
    bool overlong;

    if (byte != 0) {
        if (decoder->size < sizeof decoder->bytes)
            decoder->bytes[decoder->size++] = byte;
        else
            decoder->overlong = true;
        return FRAME_MORE;
    }
    size = decoder->size;
    overlong = decoder->overlong;
    decoder->size = 0;
    decoder->overlong = false;
    if (size == 0)
        return FRAME_MORE;
    if (overlong)
        return FRAME_BAD;
    return unwrap(raw, cobs_decode(decoder->bytes, size, raw), message) ? FRAME_MESSAGE : FRAME_BAD;
}
