#include "abstract.h"
/* The quotient is asked for only where the dividend is below 32768 divisors. */
static uint32_t open_ratio(uint32_t dividend, uint16_t divisor)
{
    uint32_t quotient;

    ASSERT(divisor != 0 && dividend < (uint32_t)divisor * 32768UL);
    ASSUME(quotient <= 32767);
    return quotient;
}
/* fix_mul(): by algebra, factors of at most 2^11 have a product of at most 2^22, and a square is not negative. */
static int32_t open_product_of(int16_t a, int16_t b)
{
    int32_t product;

    ASSUME(UP_TO(1073741824L, product));
    ASSUME(!UP_TO(MONITOR_MOST_SD_Q6, a) || !UP_TO(MONITOR_MOST_SD_Q6, b) || UP_TO(4194304L, product));
    ASSUME(a != b || product >= 0);
    return product;
}
static uint32_t open_product_of_u16(uint16_t a, uint16_t b)
{
    uint32_t product;

    ASSERT(b <= 20);
    ASSUME(product <= 1310700UL);
    return product;
}
static int16_t open_gain16(int16_t gain_q10, int16_t value)
{
    int16_t any;

    ASSERT(gain_q10 >= 0);
    ASSUME(any >= -32767);
    return any;
}
#define fix_mul open_product_of
#define fix_mul_u16 open_product_of_u16
#define fix_mul16_q10 open_gain16
#define fix_mul_q15 open_share_q15
#define fix_mul16_q15 open_share16_q15
#define fix_div_u32 open_ratio
#include "monitor/monitor.c"

static bool config_holds(const monitor_config_t *of)
{
    return WITHIN(monitor_config_t_per_sd_q15, of->per_sd_q15) && WITHIN(monitor_config_t_share_q15, of->share_q15) &&
           WITHIN(monitor_config_t_friction_q6, of->friction_q6) &&
           WITHIN(monitor_config_t_friction_mv, of->friction_mv) && WITHIN(monitor_config_t_slowest, of->slowest) &&
           WITHIN(monitor_config_t_mv_per_mm_s_q10, of->mv_per_mm_s_q10) &&
           WITHIN(monitor_config_t_surge_q10, of->surge_q10) && WITHIN(monitor_config_t_yaw_q10, of->yaw_q10) &&
           WITHIN(monitor_config_t_half_track_m_q14, of->half_track_m_q14) &&
           WITHIN(monitor_config_t_battery_per_sd_q15, of->battery_per_sd_q15) &&
           WITHIN(monitor_config_t_load_q15, of->load_q15) && WITHIN(monitor_config_t_threshold_q5, of->threshold_q5);
}

static bool rank_holds(const monitor_rank_t *of)
{
    return of->best_q7 >= 0 && of->second_q7 >= 0 && of->cause <= MONITOR_SLIP && of->size >= -32767;
}

/* A block of any innovation and signature: no CUSUM passes its threshold, and no estimate overflows. */
void monitor_takes(void)
{
    monitor_config_t config;
    monitor_state_t state;
    monitor_signature_t signature;
    int16_t signature_q6;
    uint8_t channel;
    monitor_cause_t cause;

    ASSUME(config_holds(&config) && signature_holds(&signature) && signature_below(&signature, config.threshold_q5));
    ASSUME(UP_TO(MONITOR_MOST_SD_Q6, state.innovation_q6) && UP_TO(MONITOR_MOST_SD_Q6, signature_q6));
    ASSUME(rank_holds(&state.rank) && channel < MONITOR_CHANNELS && cause >= MONITOR_FRICTION && cause <= MONITOR_SLIP);
    take(&config, &state, &signature, signature_q6, channel, cause);
    ASSERT(signature_holds(&signature) && signature_below(&signature, config.threshold_q5));
    ASSERT(rank_holds(&state.rank));
    END();
}

/* What take() is given is within its limits, and every report has a known cause, whatever the block was. */
void monitor_measures(void)
{
    monitor_config_t config;
    monitor_state_t state;
    uint8_t side, channel;

    ASSUME(config_holds(&config) && rank_holds(&state.rank) && side < 2 && channel < MONITOR_CHANNELS);
    ASSUME(state.report[channel].cause <= MONITOR_SLIP && state.quiet_blocks[channel] <= MONITOR_HOLD_BLOCKS);
    (void)measure(&config, &state, side);
    ASSERT(UP_TO(MONITOR_MOST_SD_Q6, state.innovation_q6));
    for (int i = 0; i < MONITOR_SIGNATURES; i++)
        ASSERT(UP_TO(MONITOR_MOST_SD_Q6, state.signature_q6[i]));
    decide(&config, &state, channel);
    ASSERT(state.report[channel].cause <= MONITOR_SLIP && state.quiet_blocks[channel] <= MONITOR_HOLD_BLOCKS);
    END();
}

/* The sums of a block, for any motion and voltages. */
void monitor_adds(void)
{
    monitor_config_t config;
    monitor_state_t state;
    signals_estimate_t estimate;
    signals_drive_t drive;
    uint16_t battery_mv;

    ASSUME(config_holds(&config) && WITHIN(signals_estimate_t_period_ms, estimate.period_ms) && state.jobs == 0);
    monitor_step(&config, &state, &estimate, &drive, battery_mv);
    ASSERT(state.jobs == 0 || state.jobs == JOBS);
    END();
}
