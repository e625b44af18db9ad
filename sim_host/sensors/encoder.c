#include "sensors/encoder.h"

#include <math.h>

#include "models/rcx_gen.h"

static const double TWO_PI = 6.283185307179586;

encoder_config_t encoder_config_default(void)
{
    return (encoder_config_t){.counts_per_turn = RCX_ENCODER_COUNTS_PER_TURN};
}

int64_t encoder_read(const encoder_config_t *config, double wheel_angle)
{
    return (int64_t)floor(wheel_angle / TWO_PI * config->counts_per_turn);
}
