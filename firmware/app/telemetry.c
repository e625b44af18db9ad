#include "app/telemetry.h"

static uint8_t *put_u16(uint8_t *at, uint16_t value)
{
    *at++ = (uint8_t)value;
    *at++ = (uint8_t)(value >> 8);
    return at;
}

static uint8_t *put_u32(uint8_t *at, uint32_t value)
{
    return put_u16(put_u16(at, (uint16_t)value), (uint16_t)(value >> 16));
}

static uint8_t flags(const step_state_t *state, const step_output_t *output)
{
    return (uint8_t)((output->state.at_rest ? 1U : 0U) | (output->state.valid ? 2U : 0U) |
                     (state->drive.surge_saturated != 0 ? 4U : 0U) | (state->drive.yaw_saturated != 0 ? 8U : 0U));
}

void telemetry_pack(uint32_t tick, const step_state_t *state, const step_output_t *output,
                    uint8_t record[TELEMETRY_SIZE])
{
    uint8_t *at = put_u32(record, tick);

    *at++ = (uint8_t)state->mode.mode;
    *at++ = (uint8_t)state->mode.fault;
    *at++ = (uint8_t)state->mode.guidance.phase;
    *at++ = state->mode.guidance.waypoint;
    at = put_u32(at, (uint32_t)output->state.x_um);
    at = put_u32(at, (uint32_t)output->state.y_um);
    at = put_u16(at, output->state.heading_bam16);
    at = put_u16(at, (uint16_t)output->state.speed_mm_s_q4);
    at = put_u16(at, (uint16_t)output->state.yaw_rate_mrad_s);
    at = put_u16(at, (uint16_t)state->mode.demand.speed_mm_s_q4);
    at = put_u16(at, state->mode.demand.heading_bam16);
    at = put_u16(at, (uint16_t)state->mode.guidance.cross_track_mm);
    at = put_u16(at, (uint16_t)output->effort.surge_mv);
    at = put_u16(at, (uint16_t)output->effort.yaw_mv);
    at = put_u16(at, (uint16_t)state->drive.left_q15);
    at = put_u16(at, (uint16_t)state->drive.right_q15);
    at = put_u16(at, state->battery_mv);
    *at++ = flags(state, output);
    *at = 0;
}
