/* Proves both symmetries of the mixer in two steps: drive.c is odd, and mixer.c is symmetric with any odd functions. */
#include "mirror.h"

uint32_t __CPROVER_uninterpreted_part(uint32_t, uint32_t);
uint32_t __CPROVER_uninterpreted_scaled(uint32_t, uint32_t);
uint32_t __CPROVER_uninterpreted_quotient(uint32_t, uint32_t);
int32_t __CPROVER_uninterpreted_sum(int32_t, int32_t);
uint32_t __CPROVER_uninterpreted_turning(uint32_t);
uint32_t __CPROVER_uninterpreted_needed(uint32_t, uint32_t);

static int16_t odd_share16_q15(int16_t value, int16_t factor_q15)
{
    return (int16_t)odd(value == 0 || factor_q15 == 0, (value < 0) != (factor_q15 < 0),
                        __CPROVER_uninterpreted_part(fix_abs_u16(value), fix_abs_u16(factor_q15)), FIX_INT16_MAX);
}

/* A sum changes its sign when both parts change theirs: fix_sums() proves its value. */
static int16_t odd_add16(int16_t a, int16_t b)
{
    const bool negative = a < 0 || (a == 0 && b < 0);
    const int32_t sum = __CPROVER_uninterpreted_sum(negative ? -a : a, negative ? -b : b);

    ASSUME(UP_TO(FIX_INT16_MAX, sum) && ((a != 0 || b != 0) || sum == 0));
    return (int16_t)(negative ? -sum : sum);
}

/* Equal numbers give equal products and quotients, 0 for 0 or too small a dividend. duty_q15() needs no more. */
static uint32_t same_mul_u16(uint16_t a, uint16_t b)
{
    const uint32_t product = __CPROVER_uninterpreted_scaled(a, b);
    ASSUME(product <= 65535UL * 32767UL && ((a != 0 && b != 0) || product == 0));
    return product;
}

static uint32_t same_div_u32(uint32_t dividend, uint16_t divisor)
{
    const uint32_t quotient = __CPROVER_uninterpreted_quotient(dividend, divisor);
    ASSUME(quotient <= 32767U && (dividend >= divisor || quotient == 0)); /* mixer_safe proves the first */
    return quotient;
}

#define fix_mul odd_mul
#define fix_mul16_q15 odd_share16_q15
#define fix_add16 odd_add16
#include "mixer/drive.c"
#undef fix_mul
#undef fix_add16

/* What drive_mirror() proves of drive.c, for sides that are alike and have no offset. */
static int16_t odd_turning(const drive_config_t *config, int16_t rate)
{
    (void)config;
    return (int16_t)odd(rate == 0, rate < 0, __CPROVER_uninterpreted_turning(fix_abs_u16(rate)), FIX_INT16_MAX);
}

static int16_t odd_needed(const drive_config_t *config, const drive_side_t *side, int16_t wanted_mv, int16_t speed)
{
    const bool negative = wanted_mv < 0 || (wanted_mv == 0 && speed < 0);
    const int16_t wanted = negative ? (int16_t)-wanted_mv : wanted_mv, along_it = negative ? (int16_t)-speed : speed;

    (void)config;
    (void)side;
    return (int16_t)odd(wanted_mv == 0 && speed == 0, negative,
                        __CPROVER_uninterpreted_needed((uint16_t)wanted, (uint16_t)along_it), FIX_INT16_MAX);
}

#define drive_turning_mm_s_q4 odd_turning
#define drive_voltage_mv odd_needed
#define fix_mul_u16 same_mul_u16
#define fix_div_u32 same_div_u32
#include "mixer/mixer.c"
#undef drive_turning_mm_s_q4
#undef drive_voltage_mv

/* -32768 has no mirror image. */
void drive_mirror(void)
{
    parameters_t parameters;
    const drive_config_t *const config = &parameters.config.step.mixer.drive;
    const drive_side_t *const side = &config->left;
    int16_t wanted_mv, speed, rate;

    ASSUME(settings_hold(&parameters) && wanted_mv >= -32767 && speed >= -32767 && rate >= -32767);
    drive_side_t opposite = *side;
    opposite.offset_mv = (int16_t)-side->offset_mv;
    ASSERT(drive_voltage_mv(config, &opposite, (int16_t)-wanted_mv, (int16_t)-speed) ==
           -drive_voltage_mv(config, side, wanted_mv, speed));
    ASSERT(drive_turning_mm_s_q4(config, (int16_t)-rate) == -drive_turning_mm_s_q4(config, rate));
    END();
}

static parameters_t parameters;
static mixer_state_t state, other;
static signals_effort_t effort, mirrored;
static signals_estimate_t estimate, image;
static signals_drive_t drive, opposite;

static void both(void)
{
    parameters_t any;
    signals_effort_t any_effort;
    signals_estimate_t any_estimate;
    uint16_t battery_mv;

    parameters = any;
    effort = any_effort;
    estimate = any_estimate;
    state.battery_mv = other.battery_mv = battery_mv;
    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config) && effort_holds(&effort));
    ASSUME(estimate.speed_mm_s_q4 >= -32767 && estimate.yaw_rate_mrad_s >= -32767);
    mirrored = effort;
    image = estimate;
    mirrored.yaw_mv = (int16_t)-effort.yaw_mv;
    image.yaw_rate_mrad_s = (int16_t)-estimate.yaw_rate_mrad_s;
}

/* Left and right change places. */
void mixer_mirror_sides(void)
{
    both();
    mixer_step(&parameters.config.step.mixer, &state, &effort, &estimate, &drive);
    mixer_step(&parameters.config.step.mixer, &other, &mirrored, &image, &opposite);
    ASSERT(opposite.left_mv == drive.right_mv && opposite.right_mv == drive.left_mv);
    ASSERT(opposite.left_q15 == drive.right_q15 && opposite.right_q15 == drive.left_q15);
    ASSERT(opposite.surge_saturated == drive.surge_saturated && opposite.yaw_saturated == -drive.yaw_saturated);
    END();
}

/* Forward and back: efforts and motion are negated, and so are voltages and duties. */
void mixer_mirror_ways(void)
{
    both();
    mirrored.surge_mv = (int16_t)-effort.surge_mv;
    image.speed_mm_s_q4 = (int16_t)-estimate.speed_mm_s_q4;
    mixer_step(&parameters.config.step.mixer, &state, &effort, &estimate, &drive);
    mixer_step(&parameters.config.step.mixer, &other, &mirrored, &image, &opposite);
    ASSERT(opposite.left_mv == -drive.left_mv && opposite.right_mv == -drive.right_mv);
    ASSERT(opposite.left_q15 == -drive.left_q15 && opposite.right_q15 == -drive.right_q15);
    ASSERT(opposite.surge_saturated == -drive.surge_saturated && opposite.yaw_saturated == -drive.yaw_saturated);
    END();
}
