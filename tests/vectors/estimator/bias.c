#include "estimator/bias.h"

#include "vectors.h"

enum { RUN_STEPS = 64 };

#define LIMIT 1073741824L

void vectors_feed(void)
{
    static bias_t bias;
    static int32_t limit;
    static uint8_t left, slowest_weight_bits;
    int32_t sample;

    if (left == 0) {
        left = RUN_STEPS;
        slowest_weight_bits = (uint8_t)draw_up_to(16);
        limit = draw_within(LIMIT);
        limit = limit < 0 ? -limit : limit;
        bias.value = 0;
        bias.learnt = draw_rarely(1) ? 0 : draw_up_to(65535U);
    }
    left--;
    sample = draw_within(LIMIT);
    bias_learn(&bias, sample, slowest_weight_bits, limit);
    hash_s32(bias.value);
    hash_u16(bias.learnt);
}
