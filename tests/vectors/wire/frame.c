#include "wire/frame.h"

#include "vectors.h"

static void take(frame_decoder_t *decoder, uint8_t byte)
{
    message_t message;
    const frame_status_t status = frame_take(decoder, byte, &message);

    if (status == FRAME_MORE)
        return;
    hash_u8((uint8_t)status);
    if (status == FRAME_BAD)
        return;
    hash_u16(message.id);
    hash_u8(message.size);
    for (uint8_t i = 0; i < message.size; i++)
        hash_u8(message.data[i]);
}

/* A message to a frame and back, over a line on which a byte of some is changed, lost or doubled. */
void vectors_feed(void)
{
    static frame_decoder_t decoder;
    uint8_t bytes[FRAME_SIZE_MAX];
    const uint16_t harm = draw_u16();
    message_t message;
    uint8_t size;

    message.id = draw_up_to(MESSAGE_ID_MAX);
    message.size = (uint8_t)draw_up_to(MESSAGE_DATA_MAX);
    for (uint8_t i = 0; i < message.size; i++)
        message.data[i] = (uint8_t)draw_s16();
    size = frame_encode(&message, bytes);
    hash_u8(size);
    for (uint8_t i = 0; i < size; i++) {
        hash_u8(bytes[i]);
        if ((harm & 3U) == 0 && i == ((harm >> 2) & 15U)) {
            if ((harm & 0x40U) != 0)
                take(&decoder, bytes[i] ^ (uint8_t)(harm >> 8));
            if ((harm & 0x80U) != 0)
                take(&decoder, bytes[i]);
        } else {
            take(&decoder, bytes[i]);
        }
    }
}
