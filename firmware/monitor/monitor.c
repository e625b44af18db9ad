#include "monitor/monitor.h"

#ifndef MONITOR_OFF

#include "core/bytes.h"
#include "core/fix.h"

enum {
    PARTS = MONITOR_SIGNATURES + 1, /* jobs of a wheel: measure, and one for each signature */
    JOBS = 2 * PARTS + 1,           /* and one for the battery */
    LEAST_LOAD_Q6 = 16,             /* a quarter of a standard deviation: a smaller load says nothing */
    LEAD_Q7 = 8 * 128,              /* least lead of the best explanation: a likelihood ratio of exp(4) */
    CAP_BITS = 2,                   /* a block raises a sum by a quarter of the threshold at most */
    RATIO_MOST = 32                 /* largest size, in sizes looked for */
};

#define ANGLE_MOST_URAD 16777216L

/* mV ms to 64 mV ms. */
static int16_t to_units(int32_t voltage_mv_ms)
{
    return fix_sat16(fix_trunc_shift(voltage_mv_ms, 6));
}

static void add_step(monitor_state_t *state, const signals_estimate_t *estimate, const signals_drive_t *drive,
                     uint16_t battery_mv)
{
    monitor_sums_t *const sums = &state->sums;

    sums->travel_um_q5 = fix_add32(sums->travel_um_q5, estimate->travel_um_q5);
    sums->angle_urad = fix_add32(sums->angle_urad, fix_mul(estimate->yaw_rate_mrad_s, estimate->period_ms));
    sums->voltage_mv_ms[0] = fix_add32(sums->voltage_mv_ms[0], fix_mul(drive->left_mv, estimate->period_ms));
    sums->voltage_mv_ms[1] = fix_add32(sums->voltage_mv_ms[1], fix_mul(drive->right_mv, estimate->period_ms));
    sums->battery_mv_ms =
        fix_add32(sums->battery_mv_ms, (int32_t)fix_mul_u16(state->reference_mv, estimate->period_ms) -
                                           (int32_t)fix_mul_u16(battery_mv, estimate->period_ms));
    sums->speed_mm_s_q4 = fix_add16(sums->speed_mm_s_q4, fix_sub16(estimate->speed_mm_s_q4, state->speed_mm_s_q4));
    sums->yaw_rate_mrad_s =
        fix_add16(sums->yaw_rate_mrad_s, fix_sub16(estimate->yaw_rate_mrad_s, state->yaw_rate_mrad_s));
    sums->period_ms = fix_add_u16(sums->period_ms, estimate->period_ms);
    sums->bad = sums->bad || !estimate->valid;
    state->speed_mm_s_q4 = estimate->speed_mm_s_q4;
    state->yaw_rate_mrad_s = estimate->yaw_rate_mrad_s;
    state->clock_ms += estimate->period_ms;
}

/* Limits a value to +-32 standard deviations. */
static int16_t limited_q6(int16_t value, int16_t factor_q15)
{
    return fix_clamp16(fix_mul16_q15(value, factor_q15), MONITOR_MOST_SD_Q6);
}

/* Begins the evidence of a channel in this block. */
static void begin_rank(monitor_rank_t *rank)
{
    bytes_clear(rank, sizeof *rank);
}

/* Computes innovation and signatures of a wheel. Returns false if the block says nothing about this wheel. */
static bool measure(const monitor_config_t *config, monitor_state_t *state, uint8_t side)
{
    const monitor_sums_t *const block = &state->block;
    const int32_t half_um = fix_mul_q15(fix_clamp32(block->angle_urad, ANGLE_MOST_URAD), config->half_track_m_q14);
    const int32_t turned_um_q5 = half_um * 64; /* of the left wheel */
    const int32_t travel_um_q5 = side == MONITOR_LEFT ? fix_add32(block->travel_um_q5, turned_um_q5)
                                                      : fix_sub32(block->travel_um_q5, turned_um_q5);
    const int16_t emf = fix_sat16(fix_trunc_shift(fix_mul_q15(travel_um_q5, config->mv_per_mm_s_q10), 6));
    const int16_t surge = fix_mul16_q10(config->surge_q10, block->speed_mm_s_q4);
    const int16_t turn = fix_mul16_q10(config->yaw_q10, block->yaw_rate_mrad_s);
    const int16_t yaw = side == MONITOR_LEFT ? turn : (int16_t)-turn;
    const int16_t voltage = to_units(block->voltage_mv_ms[side]);
    const int16_t left_over = fix_sub16(voltage, emf);
    const int16_t innovation = fix_sat16(fix_add(surge, yaw) - left_over);

    state->load = fix_add16(state->load, fix_mul16_q15(voltage, left_over));
    state->innovation_q6 = limited_q6(innovation, config->per_sd_q15);
    state->signature_q6[0] = emf < 0 ? config->friction_q6 : (int16_t)-config->friction_q6;
    state->signature_q6[1] = (int16_t)-limited_q6(emf, config->share_q15);
    state->signature_q6[2] = (int16_t)-limited_q6(voltage, config->share_q15);
    state->signature_q6[3] = (int16_t)-limited_q6(yaw, config->share_q15);
    return !block->bad && fix_abs_u16(emf) >= (uint16_t)config->slowest;
}

/* Adds the log likelihood ratio of a block to a CUSUM. Returns the new sum. */
static int16_t climb(const monitor_config_t *config, int16_t sum_q5, int32_t twice_ratio_q12)
{
    const int16_t cap_q5 = (int16_t)((uint16_t)config->threshold_q5 >> CAP_BITS);
    const int32_t step_q5 = fix_trunc_shift(twice_ratio_q12, 8);
    const int32_t sum = sum_q5 + (step_q5 < cap_q5 ? step_q5 : cap_q5);

    if (sum <= 0)
        return 0;
    return sum < config->threshold_q5 ? (int16_t)sum : config->threshold_q5;
}

static int32_t forget(int32_t value)
{
    return value - fix_trunc_shift(value, MONITOR_MEMORY_BITS);
}

/* |b| / a in q10, at most 32; a > 0. */
static int16_t ratio_q10(uint32_t product, uint32_t square)
{
    while (square > 65535U) {
        square >>= 1;
        product >>= 1;
    }
    if (product >> 5 >= square)
        return FIX_INT16_MAX;
    return (int16_t)fix_div_u32(product << 10, (uint16_t)square);
}

/* Compares what this signature explains with the other signatures of its channel. */
static void rank_signature(const monitor_config_t *config, const monitor_signature_t *signature, monitor_cause_t cause,
                           monitor_rank_t *rank)
{
    const uint32_t product = fix_abs_u32(signature->product_q12);
    int16_t ratio, size;
    int32_t explained_q7;

    if (signature->square_q12 <= 0)
        return;
    ratio = ratio_q10(product, (uint32_t)signature->square_q12);
    explained_q7 = fix_mul_q15((int32_t)product, ratio);
    if (explained_q7 <= rank->best_q7) {
        rank->second_q7 = explained_q7 > rank->second_q7 ? explained_q7 : rank->second_q7;
        return;
    }
    size = fix_mul16_q10(ratio, cause == MONITOR_FRICTION ? config->friction_mv : MONITOR_SHARE);
    rank->second_q7 = rank->best_q7;
    rank->best_q7 = explained_q7;
    rank->cause = cause;
    rank->size = signature->product_q12 < 0 ? (int16_t)-size : size;
}

/* Takes the block's innovation into the CUSUMs and the estimate of one signature of a channel. */
static void take(const monitor_config_t *config, monitor_state_t *state, monitor_signature_t *signature, int16_t x_q6,
                 uint8_t channel, monitor_cause_t cause)
{
    monitor_rank_t *const rank = &state->rank;
    const bool evidence = state->evidence[channel];
    const int32_t product_q12 = fix_mul(state->innovation_q6, x_q6);
    const int32_t square_q12 = fix_mul(x_q6, x_q6);

    signature->sum_q5[0] = climb(config, signature->sum_q5[0], 2 * product_q12 - square_q12);
    signature->sum_q5[1] = climb(config, signature->sum_q5[1], -2 * product_q12 - square_q12);
    signature->product_q12 = evidence ? forget(signature->product_q12) + product_q12 : 0;
    signature->square_q12 = evidence ? forget(signature->square_q12) + square_q12 : 0;
    for (uint8_t side = 0; side < 2; side++)
        rank->peak_q5 = signature->sum_q5[side] > rank->peak_q5 ? signature->sum_q5[side] : rank->peak_q5;
    rank_signature(config, signature, cause, rank);
}

/* True if the best explanation is old enough, and leads clearly. */
static bool clear(const monitor_state_t *state, const monitor_report_t *report)
{
    const monitor_rank_t *const rank = &state->rank;
    const int32_t lead_q7 = rank->best_q7 - rank->second_q7;

    return state->clock_ms - report->since_ms >= MONITOR_DECIDE_MS && lead_q7 >= LEAD_Q7 &&
           lead_q7 >= fix_trunc_shift(rank->best_q7, 4);
}

/* Reports a channel after its last signature of a block. */
static void decide(const monitor_config_t *config, monitor_state_t *state, uint8_t channel)
{
    const monitor_rank_t *const rank = &state->rank;
    monitor_report_t *const report = &state->report[channel];

    if (rank->peak_q5 >= MONITOR_QUIET_Q5) {
        state->evidence[channel] = true;
        state->quiet_blocks[channel] = 0;
    } else if (report->cause != MONITOR_NONE && state->quiet_blocks[channel] < MONITOR_HOLD_BLOCKS) {
        state->quiet_blocks[channel]++;
        return;
    } else {
        state->evidence[channel] = false;
        report->since_ms = state->clock_ms;
        report->cause = MONITOR_NONE;
        report->size = 0;
        return;
    }
    if (report->cause == MONITOR_NONE && rank->peak_q5 < config->threshold_q5)
        return;
    if (rank->cause == report->cause || clear(state, report)) {
        report->cause = rank->cause;
        report->size = rank->size;
    } else if (report->cause == MONITOR_NONE) {
        report->cause = MONITOR_UNDECIDED;
    }
}

static void do_battery(const monitor_config_t *config, monitor_state_t *state)
{
    const int16_t load_q6 = limited_q6(state->load, config->load_q15);

    if (state->block.bad || load_q6 < LEAST_LOAD_Q6)
        return;
    begin_rank(&state->rank);
    state->innovation_q6 = limited_q6(to_units(state->block.battery_mv_ms), config->battery_per_sd_q15);
    take(config, state, &state->battery, load_q6, MONITOR_BATTERY, MONITOR_SUPPLY);
    decide(config, state, MONITOR_BATTERY);
}

/* Does a job of a wheel: job 0 measures the block, each other job takes a signature. */
static void do_wheel(const monitor_config_t *config, monitor_state_t *state, uint8_t side, uint8_t job)
{
    if (job == 0) {
        begin_rank(&state->rank);
        if (!measure(config, state, side))
            state->jobs = side == MONITOR_LEFT ? PARTS + 1 : 1; /* the wheel's other jobs are left out */
    } else {
        take(config, state, &state->wheel[side][job - 1], state->signature_q6[job - 1], side,
             (monitor_cause_t)(MONITOR_FRICTION + job - 1));
        if (job == MONITOR_SIGNATURES)
            decide(config, state, side);
    }
}

/* Does the next job of the block before. */
static void do_job(const monitor_config_t *config, monitor_state_t *state)
{
    const uint8_t job = (uint8_t)(JOBS - state->jobs);

    state->jobs--;
    if (job == JOBS - 1) {
        do_battery(config, state);
    } else if (job < PARTS) {
        do_wheel(config, state, MONITOR_LEFT, job);
    } else {
        do_wheel(config, state, MONITOR_RIGHT, (uint8_t)(job - PARTS));
    }
}

void monitor_step(const monitor_config_t *config, monitor_state_t *state, const signals_estimate_t *estimate,
                  const signals_drive_t *drive, uint16_t battery_mv)
{
    if (config->per_sd_q15 == 0)
        return;
    if (!state->has_driven) {
        state->reference_mv = battery_mv;
        state->has_driven = drive->left_mv != 0 || drive->right_mv != 0;
    }
    add_step(state, estimate, drive, battery_mv);
    if (state->jobs > 0) {
        do_job(config, state);
    } else if (state->sums.period_ms >= MONITOR_BLOCK_MS) {
        bytes_copy(&state->block, &state->sums, sizeof state->block);
        bytes_clear(&state->sums, sizeof state->sums);
        state->load = 0;
        state->jobs = JOBS;
    }
}

#endif
