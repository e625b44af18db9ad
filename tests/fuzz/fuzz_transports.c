/* fuzz_transports.c: any bytes on a serial line. What is taken for a message is one that the encoder would have written. */
#include <stdlib.h>
#include <string.h>

#include "wire/frame.h"
#include "wire/slcan.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static void require(bool holds)
{
    if (!holds)
        abort();
}

static bool is_message(const message_t *message)
{
    return message->id <= MESSAGE_ID_MAX && message->size <= MESSAGE_DATA_MAX;
}

static bool same(const message_t *a, const message_t *b)
{
    return a->id == b->id && a->size == b->size && memcmp(a->data, b->data, a->size) == 0;
}

static void frames(const uint8_t *bytes, size_t size)
{
    frame_decoder_t decoder = {.size = 0}, again = {.size = 0};
    message_t message, back;

    for (size_t i = 0; i < size; i++)
        if (frame_take(&decoder, bytes[i], &message) == FRAME_MESSAGE) {
            uint8_t written[FRAME_SIZE_MAX];
            frame_status_t status = FRAME_MORE;
            require(is_message(&message));
            const uint8_t count = frame_encode(&message, written);
            require(count <= FRAME_SIZE_MAX && i + 1 >= count && memcmp(bytes + i + 1 - count, written, count) == 0);
            for (uint8_t k = 0; k < count; k++)
                status = frame_take(&again, written[k], &back);
            require(status == FRAME_MESSAGE && same(&message, &back));
        }
}

static void lines(const uint8_t *bytes, size_t size)
{
    slcan_decoder_t decoder = {.size = 0}, again = {.open = true};
    message_t message, back;

    for (size_t i = 0; i < size; i++) {
        const slcan_status_t status = slcan_take(&decoder, bytes[i], &message);
        require(status != SLCAN_REPLY || (decoder.reply_size > 0 && decoder.reply_size <= SLCAN_REPLY_MAX));
        if (status == SLCAN_MESSAGE) {
            uint8_t written[SLCAN_SIZE_MAX];
            slcan_status_t last = SLCAN_MORE;
            require(decoder.open && is_message(&message));
            const uint8_t count = slcan_encode(&message, written);
            for (uint8_t k = 0; k < count; k++)
                last = slcan_take(&again, written[k], &back);
            require(last == SLCAN_MESSAGE && same(&message, &back));
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    frames(bytes, size);
    lines(bytes, size);
    return 0;
}
