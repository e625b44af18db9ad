#include "estimator/bias.h"

#include "core/fix.h"

#ifndef FIX_IN_ASSEMBLY
void bias_learn(bias_t *bias, int32_t sample, uint8_t slowest_weight_bits, int32_t limit)
{
    const uint8_t bits = fix_bits(bias->learnt, slowest_weight_bits);
    fix_add_to(fix_fraction(fix_less(sample, &bias->value), bits), &bias->value);
    bias->value = fix_clamp32(bias->value, limit);
    bias->learnt = fix_count_u16(bias->learnt);
}
#endif
