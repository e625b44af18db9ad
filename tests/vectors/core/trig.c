#include "core/trig.h"

#include "vectors.h"

void vectors_feed(void)
{
    const uint16_t angle_bam16 = (uint16_t)draw_s16();
    const int32_t y = draw_s32(), x = draw_rarely(3) ? y : draw_s32();

    hash_s16(trig_sin_q15(angle_bam16));
    hash_s16(trig_cos_q15(angle_bam16));
    hash_u16(trig_atan2_bam16(y, x));
}
