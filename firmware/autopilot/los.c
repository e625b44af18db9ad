#include "autopilot/los.h"

#include "core/bytes.h"
#include "core/fix.h"
#include "core/trig.h"
#include "core/turns.h"

/* Distance from the robot to a waypoint on one axis, um. */
static int32_t to_waypoint_um(int16_t waypoint_mm, int32_t robot_um)
{
    return fix_sub32(fix_mul(waypoint_mm, 1000), robot_um);
}

static void look(const route_t *route, los_state_t *los, const signals_estimate_t *estimate)
{
    const route_waypoint_t *waypoint = &route->waypoints[los->waypoint];

    los->to_x_um = to_waypoint_um(waypoint->x_mm, estimate->x_um);
    los->to_y_um = to_waypoint_um(waypoint->y_mm, estimate->y_um);
    los->to_mm.x = fix_div_1000(los->to_x_um);
    los->to_mm.y = fix_div_1000(los->to_y_um);
    los->distance_squared_mm2 = fix_dot(&los->to_mm, &los->to_mm);
}

/* Sets the direction to the waypoint. Not a part of look(): a step that reaches the waypoint needs no direction. */
static void sight(los_state_t *los)
{
    los->sight_bam16 = trig_atan2_bam16(los->to_y_um, los->to_x_um);
}

static void set_direction(fix_vector_t *direction_q15, uint16_t bearing_bam16)
{
    direction_q15->x = trig_cos_q15(bearing_bam16);
    direction_q15->y = trig_sin_q15(bearing_bam16);
}

/* Sets the heading error and returns its magnitude. */
static uint16_t heading_error_bam16(los_state_t *los, const signals_estimate_t *estimate)
{
    los->heading_error_bam16 = fix_angle_diff_bam16(los->bearing_bam16, estimate->heading_bam16);
    return fix_abs_u16(los->heading_error_bam16);
}

/* Compares the distance to the waypoint with `distance_mm`. Returns a number below, equal to or above 0. */
static int16_t compare_distance(const los_state_t *los, uint16_t distance_mm)
{
    return fix_compare_square(los->distance_squared_mm2, distance_mm);
}

static void enter(los_state_t *los, los_phase_t phase)
{
    los->phase = phase;
    los->quiet_ms = 0;
}

static void enter_brake(los_state_t *los, const signals_estimate_t *estimate)
{
    los->hold_heading_bam16 = estimate->heading_bam16;
    enter(los, LOS_BRAKE);
}

static void enter_drive(los_state_t *los)
{
    set_direction(&los->pass_q15, los->sight_bam16);
    los->passing = true;
    enter(los, LOS_DRIVE);
}

static void end(los_state_t *los, los_status_t status)
{
    los->status = status;
    enter(los, LOS_END);
}

/* If the heading error is too large to keep driving, begins to brake for a turn and returns true. */
static bool pivots(const los_config_t *config, los_state_t *los, const signals_estimate_t *estimate)
{
    if (heading_error_bam16(los, estimate) <= config->pivot_bam16)
        return false;
    enter_brake(los, estimate);
    return true;
}

static void set_line(los_state_t *los, uint16_t bearing_bam16)
{
    set_direction(&los->left_q15, (uint16_t)(bearing_bam16 - TURN_QUARTER));
}

/* Begins a leg, except for the leg's line, which the caller sets. */
static void begin_leg(const los_config_t *config, const route_t *route, los_state_t *los,
                      const signals_estimate_t *estimate)
{
    look(route, los, estimate);
    sight(los);
    los->leg_ms = 0;
    los->leg_overshoots = 0;
    los->passing = false;
    los->bearing_bam16 = los->sight_bam16;
    if (!pivots(config, los, estimate))
        enter_drive(los);
}

/* Leaves a leg that has ended: its waypoint is reached (`status` is LOS_UNDERWAY), or the leg has failed. */
static void leave_leg(const los_config_t *config, const route_t *route, los_state_t *los,
                      const signals_estimate_t *estimate, los_status_t status)
{
    const route_waypoint_t *from = &route->waypoints[los->waypoint];
    const uint8_t next = (uint8_t)(los->waypoint + 1);
    uint16_t line_bam16;

    if (next < route->count && (status == LOS_UNDERWAY || config->skip_failed)) {
        los->waypoint = next;
        begin_leg(config, route, los, estimate);
        line_bam16 = los->sight_bam16;
        if (status == LOS_UNDERWAY)
            line_bam16 = trig_atan2_bam16(fix_add(from[1].y_mm, (int16_t)-from->y_mm),
                                          fix_add(from[1].x_mm, (int16_t)-from->x_mm));
        else
            los->skipped++;
        set_line(los, line_bam16);
    } else if (status == LOS_UNDERWAY) {
        los->last_reached = true;
        los->passing = false;
        enter_brake(los, estimate);
    } else {
        end(los, status);
    }
}

/* Counts an overshoot when the robot passes the plane through the waypoint. True if this leg has too many. */
static bool overshoots(const los_config_t *config, los_state_t *los, const signals_estimate_t *estimate)
{
    if (!los->passing || fix_project(&los->to_mm, &los->pass_q15) >= -(int16_t)config->overshoot_mm)
        return false;
    los->passing = false;
    los->overshoots = fix_increment_u16(los->overshoots);
    los->leg_overshoots++;
    if (los->phase == LOS_DRIVE)
        enter_brake(los, estimate);
    return los->leg_overshoots > config->max_overshoots;
}

/* Call this in each step in which the phase's end condition holds. True when the condition has held for `needed_ms`. */
static bool held(los_state_t *los, uint8_t period_ms, uint16_t needed_ms)
{
    los->quiet_ms = fix_add_u16(los->quiet_ms, period_ms);
    return los->quiet_ms >= needed_ms;
}

static void brake(const los_config_t *config, los_state_t *los, const signals_estimate_t *estimate)
{
    los->bearing_bam16 = los->sight_bam16;
    if (fix_abs_u16(estimate->speed_mm_s_q4) > config->rest_speed_mm_s_q4)
        los->quiet_ms = 0;
    else if (!held(los, estimate->period_ms, config->rest_ms))
        return;
    else if (los->last_reached)
        end(los, LOS_ARRIVED);
    else
        enter(los, LOS_TURN);
}

static void move(const los_config_t *config, los_state_t *los, const signals_estimate_t *estimate)
{
    sight(los);
    if (los->phase == LOS_BRAKE) {
        brake(config, los, estimate);
        return;
    }
    if (compare_distance(los, (uint16_t)(config->bearing_hold_mm + 1U)) >= 0)
        los->bearing_bam16 = los->sight_bam16;
    if (los->phase == LOS_DRIVE)
        (void)pivots(config, los, estimate);
    else if (heading_error_bam16(los, estimate) > config->align_bam16 ||
             fix_abs_u16(estimate->yaw_rate_mrad_s) > config->rest_yaw_rate_mrad_s)
        los->quiet_ms = 0;
    else if (held(los, estimate->period_ms, config->settle_ms))
        enter_drive(los);
}

/* The speed from which the robot can still brake: sqrt(2 * decel * distance), limited to creep..cruise. If the larger
 * coordinate of the distance alone allows cruise, no root is computed: the roots would add 3,000 states to the longest
 * step. */
static uint16_t approach_speed_mm_s_q4(const los_config_t *config, const los_state_t *los)
{
    const uint16_t cruise = (uint16_t)config->cruise_mm_s_q4, creep = (uint16_t)config->creep_mm_s_q4;
    const uint16_t twice_decel_mm_s2 = (uint16_t)(config->decel_mm_s2 << 1);
    const uint16_t y_mm = fix_abs_u16(los->to_mm.y);
    uint16_t distance_mm = fix_abs_u16(los->to_mm.x), speed;

    if (distance_mm < y_mm)
        distance_mm = y_mm;
    if (fix_mul_u16(twice_decel_mm_s2, distance_mm) >> 8 > fix_mul_u16(cruise, cruise) >> 16)
        return cruise;
    distance_mm = fix_sqrt_u32((uint32_t)los->distance_squared_mm2);
    speed = fix_sqrt_u32(fix_mul_u16(twice_decel_mm_s2, distance_mm) << 8);
    if (speed < creep)
        speed = creep;
    return speed > cruise ? cruise : speed;
}

static void steer_leg(const los_config_t *config, const route_t *route, los_state_t *los,
                      const signals_estimate_t *estimate)
{
    los_status_t status = LOS_UNDERWAY;

    los->leg_ms += estimate->period_ms;
    if ((int32_t)(config->leg_timeout_ms - los->leg_ms) < 0) {
        status = LOS_TIMED_OUT;
    } else if (los->last_reached || compare_distance(los, config->acceptance_mm) > 0) {
        if (!overshoots(config, los, estimate)) {
            move(config, los, estimate);
            return;
        }
        status = LOS_OVERSHOT;
    }
    leave_leg(config, route, los, estimate, status);
}

void los_reset(los_state_t *los)
{
    bytes_clear(los, sizeof *los);
}

void los_step(const los_config_t *config, const route_t *route, los_state_t *los, const signals_estimate_t *estimate,
              signals_demand_t *demand)
{
    if (los->phase == LOS_BEGIN) {
        begin_leg(config, route, los, estimate);
        set_line(los, los->sight_bam16);
    } else {
        look(route, los, estimate);
    }
    if (los->phase != LOS_END)
        steer_leg(config, route, los, estimate);

    demand->speed_mm_s_q4 = los->phase == LOS_DRIVE ? (int16_t)approach_speed_mm_s_q4(config, los) : 0;
    demand->heading_bam16 = los->phase == LOS_BRAKE ? los->hold_heading_bam16 : los->bearing_bam16;
    los->cross_track_mm = fix_project(&los->to_mm, &los->left_q15);
    (void)heading_error_bam16(los, estimate);
}
