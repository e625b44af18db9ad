#include "states.h"

#include "vectors.h"

#define REFERENCE_LIMIT_UM 2000000000L
#define NEAR_UM 4194304L /* 4.2 m */

void draw_sensors(signals_sensors_t *sensors)
{
    sensors->have = (uint8_t)(draw_u16() & DRAWN_SENSORS);
    sensors->period_ms = draw_rarely(2) ? (uint8_t)draw_between(1, 20) : BODY_PERIOD_MS;
    sensors->accel_surge_mm_s2 = draw_between(-32767, 32767);
    sensors->accel_sway_mm_s2 = draw_between(-32767, 32767);
    sensors->yaw_rate_mrad_s = draw_between(-32767, 32767);
    sensors->rotation_left = (uint16_t)(sensors->rotation_left + (uint16_t)draw_s16());
    sensors->rotation_right = (uint16_t)(sensors->rotation_right + (uint16_t)draw_s16());
    sensors->battery_mv = draw_up_to(32000);
    sensors->reference_x_um = draw_within(REFERENCE_LIMIT_UM);
    sensors->reference_y_um = draw_within(REFERENCE_LIMIT_UM);
    sensors->reference_heading_bam16 = (uint16_t)draw_s16();
    sensors->reference_speed_mm_s_q4 = draw_between(-32767, 32767);
    sensors->reference_yaw_rate_mrad_s = draw_between(-32767, 32767);
}

void draw_estimate(signals_estimate_t *estimate)
{
    estimate->x_um = draw_s32();
    estimate->y_um = draw_s32();
    estimate->heading_bam16 = (uint16_t)draw_s16();
    estimate->speed_mm_s_q4 = draw_between(-32767, 32767);
    estimate->yaw_rate_mrad_s = draw_between(-32767, 32767);
    estimate->accel_mm_s2 = draw_between(-32767, 32767);
    estimate->at_rest = draw_rarely(1);
    estimate->valid = !draw_rarely(4);
    estimate->bias_unknown = draw_rarely(2);
}

void draw_estimate_about(signals_estimate_t *estimate, const route_waypoint_t *waypoint, uint16_t bearing_bam16)
{
    if (draw_rarely(3)) {
        /* 1000 times, without the library: 1024 - 16 - 8 */
        const int32_t x = waypoint->x_mm, y = waypoint->y_mm;
        estimate->x_um =
            (int32_t)(((uint32_t)x << 10) - ((uint32_t)x << 4) - ((uint32_t)x << 3)) + draw_within(NEAR_UM);
        estimate->y_um =
            (int32_t)(((uint32_t)y << 10) - ((uint32_t)y << 4) - ((uint32_t)y << 3)) + draw_within(NEAR_UM);
    }
    estimate->heading_bam16 = (uint16_t)(bearing_bam16 + (draw_rarely(2) ? (uint16_t)draw_s16() : (draw_u16() & 63U)));
    estimate->speed_mm_s_q4 = draw_rarely(1) ? draw_between(-32767, 32767) : (int16_t)(draw_u16() & 3U);
    estimate->yaw_rate_mrad_s = draw_rarely(1) ? draw_between(-32767, 32767) : (int16_t)(draw_u16() & 15U);
    estimate->valid = !draw_rarely(4);
    estimate->bias_unknown = draw_rarely(2);
}

void draw_route(route_t *route, route_waypoint_t waypoints[DRAWN_WAYPOINTS])
{
    const uint8_t count = (uint8_t)draw_between(1, DRAWN_WAYPOINTS);

    for (uint8_t i = 0; i < count; i++) {
        waypoints[i].x_mm = draw_between(-ROUTE_COORDINATE_MAX_MM, ROUTE_COORDINATE_MAX_MM);
        waypoints[i].y_mm = draw_between(-ROUTE_COORDINATE_MAX_MM, ROUTE_COORDINATE_MAX_MM);
        if (i > 0 && waypoints[i].x_mm == waypoints[i - 1].x_mm && waypoints[i].y_mm == waypoints[i - 1].y_mm)
            waypoints[i].x_mm = (int16_t)(waypoints[i].x_mm < 0 ? 1 : -1);
    }
    (void)route_set(route, waypoints, count);
}

void draw_los_config(los_config_t *config)
{
    const bool usual = draw_rarely(1);

    config->acceptance_mm = (uint16_t)draw_between(1, usual ? 2000 : 32767);
    config->bearing_hold_mm = draw_up_to(usual ? 1000 : 32767);
    config->cruise_mm_s_q4 = draw_between(1, 32767);
    config->creep_mm_s_q4 = (int16_t)draw_up_to((uint16_t)config->cruise_mm_s_q4);
    config->decel_mm_s2 = (uint16_t)draw_between(1, 32767);
    config->pivot_bam16 = (uint16_t)draw_between(1, 32767);
    config->align_bam16 = (uint16_t)draw_between(1, (int16_t)config->pivot_bam16);
    config->rest_speed_mm_s_q4 = draw_up_to(usual ? 320 : 65535U);
    config->rest_ms = draw_up_to(usual ? 30 : 65535U);
    config->rest_yaw_rate_mrad_s = draw_up_to(usual ? 300 : 65535U);
    config->settle_ms = draw_up_to(usual ? 30 : 65535U);
    config->overshoot_mm = (uint16_t)draw_between(1, usual ? 300 : 32767);
    config->max_overshoots = (uint8_t)draw_up_to(usual ? 3 : 255);
    config->skip_failed = draw_rarely(1);
    config->leg_timeout_ms = usual ? 20000U : draw_up_to(300);
}

static void draw_side(drive_side_t *side)
{
    side->gain_q15 = draw_between(-32767, 32767);
    side->emf_mv_q15 = draw_s16();
    side->friction_mv = draw_between(0, 32000);
    side->offset_mv = draw_between(-32000, 32000);
}

void draw_drive_config(drive_config_t *config)
{
    draw_side(&config->left);
    draw_side(&config->right);
    config->deadband_mv = draw_between(0, 32000);
    config->half_track_m_q14 = draw_between(0, 32767);
    config->reserve_mv = draw_between(0, 32000);
}

void hash_body_state(const body_state_t *state)
{
    for (uint8_t i = 0; i < 2; i++) {
        hash_s32(state->motor[i].current_ua_q7);
        hash_s32(state->motor[i].speed_mrad_s_q13);
    }
    hash_s32(state->velocity_x_mm_s_q17);
    hash_s32(state->velocity_y_mm_s_q17);
    hash_s32(state->motion.surge_mm_s_q17);
    hash_s32(state->motion.sway_mm_s_q17);
    hash_s32(state->motion.yaw_rate_mrad_s_q12);
    hash_u32(state->heading_bam32);
    hash_s32(state->x_um);
    hash_s32(state->y_um);
    hash_s16(state->x_rest_um_q12);
    hash_s16(state->y_rest_um_q12);
}

void hash_demand(const signals_demand_t *demand)
{
    hash_u8(demand->drive);
    hash_s16(demand->speed_mm_s_q4);
    hash_u16(demand->heading_bam16);
}

void hash_los_state(const los_state_t *state)
{
    hash_s32(state->to_x_um);
    hash_s32(state->to_y_um);
    hash_s16(state->to_mm.x);
    hash_s16(state->to_mm.y);
    hash_s32(state->distance_squared_mm2);
    hash_u16(state->sight_bam16);
    hash_u8(state->phase);
    hash_u8(state->status);
    hash_u8(state->waypoint);
    hash_u8(state->skipped);
    hash_u8(state->last_reached);
    hash_u8(state->passing);
    hash_u8(state->leg_overshoots);
    hash_u16(state->overshoots);
    hash_u16(state->bearing_bam16);
    hash_s16(state->heading_error_bam16);
    hash_s16(state->cross_track_mm);
    hash_s16(state->pass_q15.x);
    hash_s16(state->pass_q15.y);
    hash_s16(state->left_q15.x);
    hash_s16(state->left_q15.y);
    hash_u16(state->hold_heading_bam16);
    hash_u16(state->quiet_ms);
    hash_u32(state->leg_ms);
}

void hash_mode_state(const mode_state_t *state, const signals_demand_t *demand)
{
    hash_u8((uint8_t)state->mode);
    hash_u8((uint8_t)state->fault);
    hash_u16(state->lost_ms);
    hash_demand(demand);
    hash_los_state(&state->los);
}

void hash_pid_output(const pid_output_t *output)
{
    hash_s16(output->output_mv);
    hash_s16(output->proportional_mv);
    hash_s16(output->integral_mv);
    hash_s16(output->derivative_mv);
    hash_u8((uint8_t)output->limited);
}

void hash_drive(const signals_drive_t *drive)
{
    hash_s16(drive->left_mv);
    hash_s16(drive->right_mv);
    hash_s16(drive->left_q15);
    hash_s16(drive->right_q15);
    hash_u8((uint8_t)drive->surge_saturated);
    hash_u8((uint8_t)drive->yaw_saturated);
}
