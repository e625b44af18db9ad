/* interface.c: the functions of brickpilot_brick.h, on top of brick.h. */
#include <stdlib.h>
#include <string.h>

#include "brick/brick.h"
#include "brickpilot_brick.h"
#include "wire/frame.h"
#include "wire/slcan.h"

struct bp_brick {
    brick_t brick;
};

bp_brick *bp_brick_new(void)
{
    bp_brick *made = malloc(sizeof *made);
    if (made != NULL)
        brick_start(&made->brick);
    return made;
}

void bp_brick_free(bp_brick *brick)
{
    free(brick);
}

static bool make(message_t *message, unsigned int id, const unsigned char *data, int size)
{
    if (id > MESSAGE_ID_MAX || size < 0 || size > MESSAGE_DATA_MAX)
        return false;
    *message = (message_t){.id = (uint16_t)id, .size = (uint8_t)size};
    if (size > 0)
        memcpy(message->data, data, (size_t)size);
    return true;
}

static int hand_over(const message_t *message, unsigned int *id, unsigned char *data)
{
    *id = message->id;
    memcpy(data, message->data, message->size);
    return message->size;
}

int bp_brick_take(bp_brick *brick, unsigned int id, const unsigned char *data, int size)
{
    message_t message;
    if (!make(&message, id, data, size))
        return -1;
    brick_take(&brick->brick, &message);
    return 0;
}

int bp_brick_give(bp_brick *brick, unsigned int *id, unsigned char *data)
{
    message_t message;
    return brick_give(&brick->brick, &message) ? hand_over(&message, id, data) : -1;
}

long long bp_brick_time(bp_brick *brick, long long now_us)
{
    return brick_time(&brick->brick, now_us);
}

int bp_frame_encode(unsigned int id, const unsigned char *data, int size, unsigned char *bytes)
{
    message_t message;
    return make(&message, id, data, size) ? frame_encode(&message, bytes) : -1;
}

int bp_frame_decode(const unsigned char *bytes, int count, unsigned int *id, unsigned char *data)
{
    frame_decoder_t decoder = {.size = 0};
    message_t message;
    for (int i = 0; i < count; i++)
        if (frame_take(&decoder, bytes[i], &message) == FRAME_MESSAGE)
            return hand_over(&message, id, data);
    return -1;
}

int bp_slcan_encode(unsigned int id, const unsigned char *data, int size, unsigned char *bytes)
{
    message_t message;
    return make(&message, id, data, size) ? slcan_encode(&message, bytes) : -1;
}

int bp_slcan_decode(const unsigned char *bytes, int count, unsigned int *id, unsigned char *data)
{
    slcan_decoder_t decoder = {.open = true};
    message_t message;
    for (int i = 0; i < count; i++)
        if (slcan_take(&decoder, bytes[i], &message) == SLCAN_MESSAGE)
            return hand_over(&message, id, data);
    return -1;
}
