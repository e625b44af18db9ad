#include "autopilot/los.h"

#include <stddef.h>

#include "core/bytes.h"
#include "core/fix.h"
#include "core/trig.h"

#define QUARTER_TURN 16384U

static int16_t look_across(int16_t waypoint_mm, const int32_t *robot_um, int32_t *to_um)
{
    *to_um = fix_less(fix_mul(waypoint_mm, 1000), robot_um);
    return fix_thousandth(*to_um);
}

static void look(los_state_t *los)
{
    const route_waypoint_t *waypoint = &los->route->waypoints[los->waypoint];

    los->to_mm.x = look_across(waypoint->x_mm, &los->signals->x_um, &los->to_x_um);
    los->to_mm.y = look_across(waypoint->y_mm, &los->signals->y_um, &los->to_y_um);
    los->distance_squared_mm2 = fix_dot(&los->to_mm, &los->to_mm);
}

/* Apart from look(): a step that finds the waypoint reached needs no direction to it. */
static void sight(los_state_t *los)
{
    los->sight_bam16 = trig_atan2_bam16(&los->to_y_um, &los->to_x_um);
}

static void look_along(fix_pair_t *direction_q15, uint16_t bearing_bam16)
{
    direction_q15->x = trig_cos_q15(bearing_bam16);
    direction_q15->y = trig_sin_q15(bearing_bam16);
}

static uint16_t heading_error_bam16(los_state_t *los)
{
    los->heading_error_bam16 = fix_angle_diff_bam16(los->bearing_bam16, los->signals->heading_bam16);
    return fix_abs_u16(los->heading_error_bam16);
}

/* How the distance to the waypoint compares with another one: less than 0, 0 or more. */
static int16_t beyond(const los_state_t *los, uint16_t distance_mm)
{
    return fix_against_square(&los->distance_squared_mm2, distance_mm);
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

/* Whose line the caller follows then. */
static void begin_leg(los_state_t *los)
{
    look(los);
    sight(los);
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

static void reach(los_state_t *los)
{
    const route_waypoint_t *from = &los->route->waypoints[los->waypoint];
    if (begin_next_leg(los)) {
        const int32_t x_mm = (int32_t)from[1].x_mm - from->x_mm, y_mm = (int32_t)from[1].y_mm - from->y_mm;
        follow_line(los, trig_atan2_bam16(&y_mm, &x_mm));
        return;
    }
    los->last_reached = true;
    los->passing = false;
    enter_brake(los);
}

/* True when this step finds the robot past the plane through the waypoint once too often. */
static bool overshoots(los_state_t *los)
{
    if (!los->passing || fix_along(&los->to_mm, &los->pass_q15) >= -(int16_t)los->config->overshoot_mm)
        return false;
    los->passing = false;
    los->overshoots = fix_count_u16(los->overshoots);
    los->leg_overshoots++;
    if (los->phase == LOS_DRIVE)
        enter_brake(los);
    return los->leg_overshoots > los->config->max_overshoots;
}

/* What ends the phase holds in this step: whether it has for long enough. */
static bool held(los_state_t *los, uint16_t needed_ms)
{
    los->quiet_ms = fix_add_u16(los->quiet_ms, los->signals->sensors.period_ms);
    return los->quiet_ms >= needed_ms;
}

static void brake(los_state_t *los)
{
    const los_config_t *config = los->config;
    los->bearing_bam16 = los->sight_bam16;
    if (fix_abs_u16(los->signals->speed_mm_s_q4) > config->rest_speed_mm_s_q4)
        los->quiet_ms = 0;
    else if (!held(los, config->rest_ms))
        return;
    else if (los->last_reached)
        end(los, LOS_ARRIVED);
    else
        enter(los, LOS_TURN);
}

static void move(los_state_t *los)
{
    const los_config_t *config = los->config;
    sight(los);
    if (los->phase == LOS_BRAKE) {
        brake(los);
        return;
    }
    if (beyond(los, (uint16_t)(config->bearing_hold_mm + 1U)) >= 0)
        los->bearing_bam16 = los->sight_bam16;
    if (los->phase == LOS_DRIVE)
        (void)pivots(los);
    else if (heading_error_bam16(los) > config->align_bam16 ||
             fix_abs_u16(los->signals->yaw_rate_mrad_s) > config->rest_yaw_rate_mrad_s)
        los->quiet_ms = 0;
    else if (held(los, config->settle_ms))
        enter_drive(los);
}

static uint16_t twice_decel_mm_s2(const los_state_t *los)
{
    return (uint16_t)(los->config->decel_mm_s2 << 1);
}

/* The speed from which the robot can still brake: the square root of 2 decel distance. No root where the larger part of the
 * distance is enough for cruise. */
static uint16_t approach_speed_mm_s_q4(const los_state_t *los)
{
    const uint16_t cruise = (uint16_t)los->config->cruise_mm_s_q4;
    const uint16_t cruise_squared_high = (uint16_t)(fix_mul_u16(cruise, cruise) >> 16);
    const uint16_t y_mm = fix_abs_u16(los->to_mm.y);
    uint16_t distance_mm = fix_abs_u16(los->to_mm.x), speed;

    if (distance_mm < y_mm)
        distance_mm = y_mm;
    if (fix_mul_u16(twice_decel_mm_s2(los), distance_mm) >> 8 > cruise_squared_high)
        return cruise;
    distance_mm = fix_sqrt_u32((uint32_t)los->distance_squared_mm2);
    speed = fix_sqrt_u32(fix_mul_u16(twice_decel_mm_s2(los), distance_mm) << 8);
    if (speed > cruise)
        speed = cruise;
    if (speed < (uint16_t)los->config->creep_mm_s_q4)
        speed = (uint16_t)los->config->creep_mm_s_q4;
    return speed;
}

static void steer_leg(los_state_t *los)
{
    los_status_t failed;

    los->leg_ms += los->signals->sensors.period_ms;
    if ((int32_t)(los->config->leg_timeout_ms - los->leg_ms) < 0) {
        failed = LOS_TIMED_OUT;
    } else if (!los->last_reached && beyond(los, los->config->acceptance_mm) <= 0) {
        reach(los);
        return;
    } else if (overshoots(los)) {
        failed = LOS_OVERSHOT;
    } else {
        move(los);
        return;
    }
    if (los->config->skip_failed && begin_next_leg(los)) {
        los->skipped++;
        follow_line(los, los->sight_bam16);
    } else {
        end(los, failed);
    }
}

void los_reset(los_state_t *los)
{
    bytes_clear(&los->to_x_um, (uint16_t)(sizeof *los - offsetof(los_state_t, to_x_um)));
}

void los_step(const los_config_t *config, const route_t *route, los_state_t *los, const signals_state_t *signals)
{
    los->config = config;
    los->route = route;
    los->signals = signals;
    if (los->phase == LOS_BEGIN) {
        begin_leg(los);
        follow_line(los, los->sight_bam16);
    } else {
        look(los);
    }
    if (los->phase != LOS_END)
        steer_leg(los);

    los->demand.speed_mm_s_q4 = los->phase == LOS_DRIVE ? (int16_t)approach_speed_mm_s_q4(los) : 0;
    los->demand.heading_bam16 = los->phase == LOS_BRAKE ? los->hold_heading_bam16 : los->bearing_bam16;
    los->cross_track_mm = fix_along(&los->to_mm, &los->left_q15);
    (void)heading_error_bam16(los);
}
