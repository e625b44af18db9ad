#include "contracts.h"
#include "core/trig.c"

void trig_sine(void)
{
    uint16_t angle;
    const int16_t sine = trig_sin_q15(angle), cosine = trig_cos_q15(angle);

    ASSERT(UP_TO(32767, sine) && UP_TO(32767, cosine));
    END();
}

void trig_arctan(void)
{
    int32_t x, y;

    (void)trig_atan2_bam16(y, x);
    END();
}

void trig_arctan_mirror(void)
{
    int32_t x, y;

    ASSUME(y > -2147483647L - 1 && y != 0);
    ASSERT(trig_atan2_bam16(-y, x) == (uint16_t)(0U - trig_atan2_bam16(y, x)));
    END();
}
