#include "model/scale.h"

#include "vectors.h"

void vectors_feed(void)
{
    const int16_t magnitude = draw_between(16384, 32767);
    const uint16_t how = draw_u16();
    const scale_t scale = {.mantissa = (how & 0x1FU) == 0   ? 0
                                       : (how & 0x20U) != 0 ? (int16_t)-magnitude
                                                            : magnitude,
                           .shift = (uint8_t)((how >> 8) & 31U)};
    const int32_t value = draw_s32();

    hash_s32(scale_apply(&scale, value));
    hash_s32(scale_apply16(&scale, draw_s16()));
}
