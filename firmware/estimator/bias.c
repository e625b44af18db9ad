#include "estimator/bias.h"

#include "core/fix.h"

void bias_learn(bias_t *bias, int32_t sample, uint8_t slowest_weight_bits, int32_t limit)
{
    const uint8_t bits = fix_bit_length(bias->learnt, slowest_weight_bits);
    bias->value = fix_clamp32(bias->value + fix_trunc_shift(fix_sub32(sample, bias->value), bits), limit);
    bias->learnt = fix_increment_u16(bias->learnt);
}
