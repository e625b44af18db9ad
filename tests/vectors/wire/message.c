#include "wire/message.h"

#include "vectors.h"

void vectors_feed(void)
{
    uint32_t wide = (uint32_t)draw_s32();
    uint16_t narrow = draw_u16();
    uint8_t bytes[4] = {0, 0, 0, 0}, byte = (uint8_t)draw_u16();

    message_move(bytes, &wide, sizeof wide);
    hash_u16(message_get(bytes));
    hash_u16(message_get(bytes + 2));
    message_put(bytes + 1, narrow);
    message_move(&wide, bytes, sizeof wide);
    hash_u32(wide);
    message_move(&narrow, bytes + 2, sizeof narrow);
    hash_u16(narrow);
    message_move(bytes, &byte, sizeof byte);
    hash_u8(bytes[0]);
}
