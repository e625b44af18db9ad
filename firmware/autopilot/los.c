#include "autopilot/los.h"

#include "core/fix.h"
#include "core/trig.h"

#define QUARTER_TURN 16384U

static int32_t product(const los_vector_t *a, const los_vector_t *b)
{
    const int32_t x = fix_mul(a->x, b->x);
    return x + fix_mul(a->y, b->y);
}

/* How far the waypoint lies in a direction. */
static int16_t along_mm(const los_state_t *los, const los_vector_t *direction_q15)
{
    return fix_sat16(fix_round_shift(product(&los->to_mm, direction_q15), 15));
}

/* From a position to the waypoint, in one coordinate, which is both structs' first. */
static int32_t between_um(const int16_t *waypoint_mm, const int32_t *position_um)
{
    return fix_sub32(fix_mul(*waypoint_mm, 1000), *position_um);
}

/* By magnitude, so that both directions round alike; 16777 / 2^24 is 1/1000, low by 13 parts in a million. */
static int16_t mm_from_um(int32_t um)
{
    const int16_t magnitude = fix_sat16(fix_round_shift((int32_t)fix_mul_u32_q16(fix_abs_u32(um), 16777), 8));
    return um < 0 ? (int16_t)-magnitude : magnitude;
}

static void look(los_state_t *los)
{
    const route_waypoint_t *waypoint = &los->route->waypoints[los->waypoint];
    const int32_t x_um = between_um(&waypoint->x_mm, &los->signals->x_um);
    const int32_t y_um = between_um(&waypoint->y_mm, &los->signals->y_um);

    los->to_mm.x = mm_from_um(x_um);
    los->to_mm.y = mm_from_um(y_um);
    los->distance_squared_mm2 = product(&los->to_mm, &los->to_mm);
    los->sight_bam16 = trig_atan2_bam16(y_um, x_um);
}

static void look_along(los_vector_t *direction_q15, uint16_t bearing_bam16)
{
    direction_q15->x = trig_cos_q15(bearing_bam16);
    direction_q15->y = trig_sin_q15(bearing_bam16);
}

static uint16_t heading_error_bam16(los_state_t *los)
{
    los->heading_error_bam16 = fix_angle_diff_bam16(los->bearing_bam16, los->signals->heading_bam16);
    return fix_abs_u16(los->heading_error_bam16);
}

/* The square of the distance to the waypoint, less that of a distance. */
static int32_t beyond_mm2(const los_state_t *los, uint16_t distance_mm)
{
    return los->distance_squared_mm2 - (int32_t)fix_mul_u16(distance_mm, distance_mm);
}

static void enter(los_state_t *los, los_phase_t phase)
{
    los->phase = phase;
    los->quiet_ms = 0;
}

static void enter_brake(los_state_t *los)
{
    los->hold_heading_bam16 = los->signals->heading_bam16;
    enter(los, LOS_BRAKE);
}

static void enter_drive(los_state_t *los)
{
    look_along(&los->pass_q15, los->sight_bam16);
    los->passing = true;
    enter(los, LOS_DRIVE);
}

static void end(los_state_t *los, los_status_t status)
{
    los->status = status;
    enter(los, LOS_END);
}

/* True where it is too large to drive. */
static bool pivots(los_state_t *los)
{
    if (heading_error_bam16(los) <= los->config->pivot_bam16)
        return false;
    enter_brake(los);
    return true;
}

static void follow_line(los_state_t *los, uint16_t bearing_bam16)
{
    look_along(&los->left_q15, (uint16_t)(bearing_bam16 - QUARTER_TURN));
}

static void begin_leg(los_state_t *los)
{
    look(los);
    follow_line(los, los->sight_bam16);
    los->leg_ms = 0;
    los->leg_overshoots = 0;
    los->passing = false;
    los->bearing_bam16 = los->sight_bam16;
    if (!pivots(los))
        enter_drive(los);
}

/* False when there is none. */
static bool begin_next_leg(los_state_t *los)
{
    const uint8_t next = (uint8_t)(los->waypoint + 1);
    if (next >= los->route->count)
        return false;
    los->waypoint = next;
    begin_leg(los);
    return true;
}

static int32_t difference(const int16_t *coordinates)
{
    return (int32_t)coordinates[2] - coordinates[0];
}

static void reach(los_state_t *los)
{
    const route_waypoint_t *from = &los->route->waypoints[los->waypoint];
    if (begin_next_leg(los)) {
        follow_line(los, trig_atan2_bam16(difference(&from->y_mm), difference(&from->x_mm)));
        return;
    }
    los->last_reached = true;
    enter_brake(los);
}

static void fail(los_state_t *los, los_status_t status)
{
    if (los->config->skip_failed && begin_next_leg(los))
        los->skipped++;
    else
        end(los, status);
}

/* True when this step finds the robot past the plane through the waypoint once too often. */
static bool overshoots(los_state_t *los)
{
    if (!los->passing || along_mm(los, &los->pass_q15) >= -(int16_t)los->config->overshoot_mm)
        return false;
    los->passing = false;
    los->overshoots = fix_count_u16(los->overshoots);
    los->leg_overshoots++;
    if (los->phase == LOS_DRIVE)
        enter_brake(los);
    return los->leg_overshoots > los->config->max_overshoots;
}

/* Whether a condition that ends the phase has held for long enough. */
static bool held(los_state_t *los, bool now, uint16_t needed_ms)
{
    los->quiet_ms = now ? fix_add_u16(los->quiet_ms, los->period_ms) : 0;
    return now && los->quiet_ms >= needed_ms;
}

static void brake(los_state_t *los)
{
    const los_config_t *config = los->config;
    los->bearing_bam16 = los->sight_bam16;
    if (!held(los, fix_abs_u16(los->signals->speed_mm_s_q4) <= config->rest_speed_mm_s_q4, config->rest_ms))
        return;
    if (los->last_reached)
        end(los, LOS_ARRIVED);
    else
        enter(los, LOS_TURN);
}

static void move(los_state_t *los)
{
    const los_config_t *config = los->config;
    if (los->phase == LOS_BRAKE) {
        brake(los);
        return;
    }
    if (beyond_mm2(los, (uint16_t)(config->bearing_hold_mm + 1U)) >= 0)
        los->bearing_bam16 = los->sight_bam16;
    if (los->phase == LOS_DRIVE)
        (void)pivots(los);
    else if (held(los,
                  heading_error_bam16(los) <= config->align_bam16 &&
                      fix_abs_u16(los->signals->yaw_rate_mrad_s) <= config->rest_yaw_rate_mrad_s,
                  config->settle_ms))
        enter_drive(los);
}

/* The speed from which the robot can still brake: the square root of 2 decel distance. No root where the larger part of the
 * distance is enough for cruise. */
static int16_t approach_speed_mm_s_q4(const los_state_t *los)
{
    const los_config_t *config = los->config;
    const uint16_t cruise = (uint16_t)config->cruise_mm_s_q4;
    const uint16_t x_mm = fix_abs_u16(los->to_mm.x), y_mm = fix_abs_u16(los->to_mm.y);
    uint16_t braking;

    if (fix_mul_u16(config->decel_mm_s2, x_mm > y_mm ? x_mm : y_mm) << 1 > (fix_mul_u16(cruise, cruise) - 1U) >> 8)
        return config->cruise_mm_s_q4;
    braking =
        fix_sqrt_u32(fix_mul_u16(config->decel_mm_s2, fix_sqrt_u32((uint32_t)los->distance_squared_mm2)) << 1 << 8);
    if (braking > cruise)
        return config->cruise_mm_s_q4;
    return braking > (uint16_t)config->creep_mm_s_q4 ? (int16_t)braking : config->creep_mm_s_q4;
}

static void steer_leg(los_state_t *los)
{
    los->leg_ms += los->period_ms;
    if (los->leg_ms > los->config->leg_timeout_ms)
        fail(los, LOS_TIMED_OUT);
    else if (los->last_reached)
        brake(los);
    else if (beyond_mm2(los, los->config->acceptance_mm) <= 0)
        reach(los);
    else if (overshoots(los))
        fail(los, LOS_OVERSHOT);
    else
        move(los);
}

void los_reset(los_state_t *los)
{
    los->phase = LOS_BEGIN;
    los->status = LOS_UNDERWAY;
    los->waypoint = 0;
    los->last_reached = false;
    los->hold_heading_bam16 = 0;
    los->overshoots = 0;
    los->skipped = 0;
}

void los_step(const los_config_t *config, const route_t *route, los_state_t *los, const signals_state_t *signals,
              uint8_t period_ms, signals_demand_t *demand)
{
    los->config = config;
    los->route = route;
    los->signals = signals;
    los->period_ms = period_ms;
    if (los->phase == LOS_BEGIN)
        begin_leg(los);
    else
        look(los);
    if (los->phase != LOS_END)
        steer_leg(los);

    demand->drive = los->phase != LOS_END;
    demand->speed_mm_s_q4 = los->phase == LOS_DRIVE ? approach_speed_mm_s_q4(los) : 0;
    demand->heading_bam16 = los->phase == LOS_BRAKE ? los->hold_heading_bam16 : los->bearing_bam16;
    los->cross_track_mm = along_mm(los, &los->left_q15);
    (void)heading_error_bam16(los);
}
