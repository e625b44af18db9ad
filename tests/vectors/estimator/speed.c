#include "estimator/speed.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 32 };

#define PREDICTED_LIMIT_MM_S_Q17 1074790400L /* 8.2 m/s */

static void draw_config(speed_config_t *config)
{
    config->accel_gain_q15 = draw_between(0, 32767);
    config->slowest_weight_bits = (uint8_t)draw_up_to(12);
    config->count_travel_um_q2 = (uint16_t)(draw_up_to(65534U) + 1U);
    config->count_mismatch_q15 = draw_between(-32767, 32767);
    config->travel_gain_q15 = draw_between(0, 32767);
    config->speed_gain_q15 = draw_between(0, 32767);
    config->accel_filter_q15 = draw_between(1, 32767);
    config->friction.mv_per_mm_s2_q10 = draw_between(0, 32767);
    config->friction.half_track_m_q14 = draw_between(0, 32767);
}

static void begin(speed_state_t *state)
{
    bytes_clear(state, sizeof *state);
    if (draw_rarely(1))
        return;
    state->speed_mm_s_q17 = draw_within(BODY_SPEED_LIMIT_MM_S_Q17);
    state->speed_mm_s_q4 = draw_s16();
    state->sway_mm_s_q4 = draw_s16();
    state->residual_um_q5 = draw_within(SPEED_RESIDUAL_LIMIT_UM_Q5);
    state->bias.value = draw_within(4096000L); /* 1 m/s^2 */
    state->bias.learnt = draw_up_to(65535U);
    state->rotation_known = draw_rarely(1);
    if ((DRAWN_SENSORS & SENSOR_ROTATION) == 0) {
        state->residual_um_q5 = 0;
        state->rotation_known = false;
    }
}

static void hash(const speed_state_t *state, const signals_estimate_t *estimate, int32_t correction_mm_s_q17)
{
    hash_s32(state->speed_mm_s_q17);
    hash_s16(estimate->speed_mm_s_q4);
    hash_s16(state->sway_mm_s_q4);
    hash_s32(state->residual_um_q5);
    hash_s32(state->accel_mm_s2_q8);
    hash_s32(state->bias.value);
    hash_u16(state->bias.learnt);
    hash_u16(state->rotation_left);
    hash_u16(state->rotation_right);
    hash_u8(state->rotation_known);
    hash_s32(correction_mm_s_q17);
    hash_s16(estimate->speed_mm_s_q4);
    hash_s16(estimate->accel_mm_s2);
    hash_s32(estimate->travel_um_q5);
    hash_s32(estimate->sway_travel_um_q5);
#ifndef FRICTION_UNLEARNT
    hash_u16(state->friction.learnt_mv_q4);
#endif
}

void vectors_feed(void)
{
    static speed_config_t config;
    static speed_state_t state;
    static signals_sensors_t sensors;
    static signals_predicted_t predicted;
    static signals_estimate_t estimate;
    static uint8_t left;
    int32_t correction_mm_s_q17;

    if (left == 0) {
        left = RUN_STEPS;
        draw_config(&config);
        if (!draw_rarely(1))
            bytes_copy_flash(&config, &PARAMS.step.speed, sizeof config);
        begin(&state);
    }
    left--;
    draw_sensors(&sensors);
    predicted.motion.surge_mm_s_q17 =
        draw_rarely(1) ? draw_within(PREDICTED_LIMIT_MM_S_Q17) : state.speed_mm_s_q17 + draw_within(131072L);
    predicted.motion.sway_mm_s_q17 = draw_rarely(1) ? draw_within(PREDICTED_LIMIT_MM_S_Q17) : 0;
    estimate.yaw_rate_mrad_s = draw_between(-32767, 32767);
    estimate.at_rest = draw_rarely(2);
    correction_mm_s_q17 = speed_step(&config, &state, &sensors, &predicted, &estimate);
    hash(&state, &estimate, correction_mm_s_q17);
}
