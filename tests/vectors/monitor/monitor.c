#include "monitor/monitor.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

#ifdef MONITOR_OFF
void vectors_feed(void) {}
#else

enum { RUN_STEPS = 512 };

static void draw_config(monitor_config_t *config)
{
    config->per_sd_q15 = draw_rarely(4) ? (int16_t)0 : draw_between(0, 32767);
    config->share_q15 = draw_between(0, 32767);
    config->friction_q6 = draw_between(0, MONITOR_MOST_SD_Q6);
    config->friction_mv = draw_between(1, 32767);
    config->slowest = draw_between(0, 2000);
    config->mv_per_mm_s_q10 = draw_between(0, 32767);
    config->surge_q10 = draw_between(0, 32767);
    config->yaw_q10 = draw_between(0, 32767);
    config->half_track_m_q14 = draw_between(0, 32767);
    config->battery_per_sd_q15 = draw_between(0, 32767);
    config->load_q15 = draw_between(0, 32767);
    config->threshold_q5 = draw_between(MONITOR_QUIET_Q5, 2000);
}

static void hash_signature(const monitor_signature_t *signature)
{
    hash_s16(signature->sum_q5[0]);
    hash_s16(signature->sum_q5[1]);
    hash_s32(signature->product_q12);
    hash_s32(signature->square_q12);
}

static void hash(const monitor_state_t *state)
{
    for (uint8_t i = 0; i < MONITOR_SIGNATURES; i++) {
        hash_signature(&state->wheel[0][i]);
        hash_signature(&state->wheel[1][i]);
    }
    hash_signature(&state->battery);
    for (uint8_t i = 0; i < MONITOR_CHANNELS; i++) {
        hash_u8(state->report[i].cause);
        hash_u8(state->quiet_blocks[i]);
        hash_s16(state->report[i].size);
        hash_s32((int32_t)state->report[i].since_ms);
    }
    hash_s16(state->innovation_q6);
    hash_u8(state->jobs);
}

/* A run either is of any inputs, or of a robot that drives steadily, so that causes are named. */
static void draw_step(signals_estimate_t *estimate, signals_drive_t *drive, uint16_t *battery_mv, bool any)
{
    estimate->period_ms = draw_rarely(3) ? (uint8_t)draw_between(1, 20) : STEP_MS;
    estimate->valid = !draw_rarely(8);
    if (any) {
        estimate->travel_um_q5 = draw_s32();
        estimate->speed_mm_s_q4 = draw_s16();
        estimate->yaw_rate_mrad_s = draw_s16();
        drive->left_mv = draw_s16();
        drive->right_mv = draw_s16();
        *battery_mv = draw_up_to(32000U);
        return;
    }
    if (!draw_rarely(5))
        return;
    estimate->travel_um_q5 = draw_within(60000L);
    estimate->speed_mm_s_q4 = draw_between(-8000, 8000);
    estimate->yaw_rate_mrad_s = draw_between(-6000, 6000);
    drive->left_mv = draw_between(-9000, 9000);
    drive->right_mv = draw_between(-9000, 9000);
    *battery_mv = (uint16_t)(7000U + draw_up_to(2000U));
}

void vectors_feed(void)
{
    static monitor_config_t config;
    static monitor_state_t state;
    static signals_estimate_t estimate;
    static signals_drive_t drive;
    static uint16_t battery_mv;
    static uint16_t left;
    static bool any;

    if (left == 0) {
        left = RUN_STEPS;
        any = draw_rarely(2);
        if (draw_rarely(1))
            draw_config(&config);
        else
            bytes_copy(&config, PARAMS.step.monitor, sizeof config);
        bytes_clear(&state, sizeof state);
        bytes_clear(&estimate, sizeof estimate);
        bytes_clear(&drive, sizeof drive);
    }
    left--;
    draw_step(&estimate, &drive, &battery_mv, any);
    monitor_step(&config, &state, &estimate, &drive, battery_mv);
    hash(&state);
}
#endif
