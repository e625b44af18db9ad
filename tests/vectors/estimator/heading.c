#include "estimator/heading.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 255 };

static void draw_config(heading_config_t *config)
{
    config->quiet_mrad_s = (uint16_t)draw_between(1, 32767);
    config->rest_speed_mm_s_q4 = draw_up_to(32767);
    config->slowest_weight_bits = (uint8_t)draw_up_to(7);
    config->blind_ms = draw_up_to(65000U);
    config->gyro_full_mrad_s = (uint16_t)draw_between(1, 32767);
    config->gyro_bias_mrad_s = draw_s16();
    config->gyro_scale_q15 = draw_between(-32767, 32767);
}

static void begin(heading_state_t *state)
{
    bytes_clear(state, sizeof *state);
    state->heading_bam32 = (uint32_t)draw_s32();
    if (draw_rarely(1))
        return;
    state->raw_rate_mrad_s = draw_between(-32767, 32767);
    state->bias.value = draw_between(-127 * 256, 127 * 256);
    state->bias.learnt = draw_up_to(65535U);
    state->blind_ms = draw_up_to(65000U);
    state->full_steps = draw_up_to(65535U);
}

static void hash(const heading_state_t *state, const signals_estimate_t *estimate)
{
    hash_u32(state->heading_bam32);
    hash_s16(state->raw_rate_mrad_s);
    hash_s32(state->bias.value);
    hash_u16(state->bias.learnt);
    hash_u8(state->block_steps);
    if (state->block_steps > 0) {
        hash_s32(state->block_sum_mrad_s);
        hash_s16(state->block_least_mrad_s);
        hash_s16(state->block_most_mrad_s);
    }
    hash_u16(state->blind_ms);
    hash_u16(state->full_steps);
    hash_u16(estimate->heading_bam16);
    hash_s16(estimate->yaw_rate_mrad_s);
    hash_u8(estimate->at_rest);
    hash_u8(state->bias.learnt > 0);
    hash_u8(estimate->valid);
    hash_u8(estimate->bias_unknown);
}

/* Half of the runs are of a robot that stands, whose bias is learnt. */
void vectors_feed(void)
{
    static heading_config_t config;
    static heading_state_t state;
    static signals_sensors_t drawn_sensors, *const sensors = &drawn_sensors;
    static signals_predicted_t predicted;
    static signals_estimate_t estimate;
    static uint8_t left;
    static bool stands;

    if (left == 0) {
        left = RUN_STEPS;
        stands = draw_rarely(1);
        draw_config(&config);
        if (!draw_rarely(1))
            bytes_copy_flash(&config, &PARAMS.step.heading, sizeof config);
        begin(&state);
    }
    left--;
    if (stands) {
        sensors->have = (uint8_t)((SENSOR_ROTATION | (draw_rarely(4) ? 0 : SENSOR_GYRO)) & DRAWN_SENSORS);
        sensors->period_ms = BODY_PERIOD_MS;
        sensors->yaw_rate_mrad_s =
            (int16_t)((sensors->rotation_left & 127U) + (draw_u16() & 63U)); /* a bias, and noise */
        predicted.motion.surge_mm_s_q17 = 0;
        predicted.driven = draw_rarely(8);
    } else {
        draw_sensors(sensors);
        predicted.motion.surge_mm_s_q17 = draw_between(-32767, 32767) * 8192L;
        predicted.driven = draw_rarely(1);
    }
    predicted.motion.yaw_rate_mrad_s_q12 = draw_between(-32767, 32767) * 4096L;
    heading_step(&config, &state, sensors, &predicted, &estimate);
    hash(&state, &estimate);
}
