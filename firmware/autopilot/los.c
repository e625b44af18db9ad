#include "autopilot/los.h"

#include "core/fix.h"
#include "core/trig.h"

/* The waypoint as seen from the robot, in the axes of the arena. */
typedef struct {
    int16_t x_mm;
    int16_t y_mm;
    uint32_t distance_squared_mm2;
    uint16_t bearing_bam16;
} sight_t;

/* By magnitude, so that both directions round alike; 16777 / 2^24 is 1/1000, low by 13 parts in a million. */
static int16_t mm_from_um(int32_t um)
{
    const int32_t magnitude = fix_round_shift((int32_t)fix_mul_u32_q16(fix_abs_u32(um), 16777), 8);
    return fix_sat16(um < 0 ? -magnitude : magnitude);
}

static int32_t um_from_mm(int16_t mm)
{
    return fix_mul(mm, 1000);
}

static void look(sight_t *sight, const route_waypoint_t *waypoint, const signals_state_t *signals)
{
    const int32_t x_um = fix_sub32(um_from_mm(waypoint->x_mm), signals->x_um);
    const int32_t y_um = fix_sub32(um_from_mm(waypoint->y_mm), signals->y_um);
    sight->x_mm = mm_from_um(x_um);
    sight->y_mm = mm_from_um(y_um);
    sight->distance_squared_mm2 =
        (uint32_t)fix_mul(sight->x_mm, sight->x_mm) + (uint32_t)fix_mul(sight->y_mm, sight->y_mm);
    sight->bearing_bam16 = trig_atan2_bam16(y_um, x_um);
}

static void look_along(los_direction_t *direction, uint16_t bearing_bam16)
{
    direction->cos_q15 = trig_cos_q15(bearing_bam16);
    direction->sin_q15 = trig_sin_q15(bearing_bam16);
}

/* How far the waypoint is ahead, and how far to the left, of who looks along `direction`. */
static int16_t ahead_mm(const sight_t *sight, const los_direction_t *direction)
{
    const int32_t x = fix_mul(sight->x_mm, direction->cos_q15);
    return fix_sat16(fix_round_shift(x + fix_mul(sight->y_mm, direction->sin_q15), 15));
}

static int16_t left_mm(const sight_t *sight, const los_direction_t *direction)
{
    const int32_t x = fix_mul(sight->x_mm, direction->sin_q15);
    return fix_sat16(fix_round_shift(x - fix_mul(sight->y_mm, direction->cos_q15), 15));
}

/* Rounded down to mm, the waypoint is farther than that. */
static bool beyond(const sight_t *sight, uint16_t distance_mm)
{
    return sight->distance_squared_mm2 > fix_mul_u16(distance_mm, distance_mm) + 2UL * distance_mm;
}

static uint16_t heading_error_bam16(const los_state_t *state, const signals_state_t *signals)
{
    return fix_abs_u16(fix_angle_diff_bam16(state->bearing_bam16, signals->heading_bam16));
}

static void enter(los_state_t *state, los_phase_t phase)
{
    state->phase = phase;
    state->quiet_ms = 0;
}

static void enter_brake(los_state_t *state, const signals_state_t *signals)
{
    state->hold_heading_bam16 = signals->heading_bam16;
    enter(state, LOS_BRAKE);
}

static void enter_drive(los_state_t *state, const sight_t *sight)
{
    look_along(&state->pass, sight->bearing_bam16);
    state->passing = true;
    enter(state, LOS_DRIVE);
}

static void begin_leg(const los_config_t *config, los_state_t *state, const sight_t *sight,
                      const signals_state_t *signals)
{
    state->leg_ms = 0;
    state->leg_overshoots = 0;
    state->passing = false;
    state->bearing_bam16 = sight->bearing_bam16;
    if (heading_error_bam16(state, signals) > config->pivot_bam16)
        enter_brake(state, signals);
    else
        enter_drive(state, sight);
}

static void end(los_state_t *state, los_status_t status)
{
    state->status = status;
    enter(state, LOS_END);
}

static void reach(const los_config_t *config, const route_t *route, los_state_t *state, sight_t *sight,
                  const signals_state_t *signals)
{
    if (state->waypoint + 1 >= route->count) {
        state->last_reached = true;
        enter_brake(state, signals);
        return;
    }
    const route_waypoint_t *from = &route->waypoints[state->waypoint];
    state->waypoint++;
    const route_waypoint_t *to = &route->waypoints[state->waypoint];
    look_along(&state->leg, trig_atan2_bam16((int32_t)to->y_mm - from->y_mm, (int32_t)to->x_mm - from->x_mm));
    look(sight, to, signals);
    begin_leg(config, state, sight, signals);
}

static void fail(const los_config_t *config, const route_t *route, los_state_t *state, sight_t *sight,
                 const signals_state_t *signals, los_status_t status)
{
    if (!config->skip_failed || state->waypoint + 1 >= route->count) {
        end(state, status);
        return;
    }
    state->skipped++;
    state->waypoint++;
    look(sight, &route->waypoints[state->waypoint], signals);
    look_along(&state->leg, sight->bearing_bam16);
    begin_leg(config, state, sight, signals);
}

/* True when this step finds the robot past the plane through the waypoint. */
static bool overshoots(const los_config_t *config, los_state_t *state, const sight_t *sight,
                       const signals_state_t *signals)
{
    if (!state->passing || ahead_mm(sight, &state->pass) >= -(int32_t)config->overshoot_mm)
        return false;
    state->passing = false;
    state->overshoots = fix_count_u16(state->overshoots);
    state->leg_overshoots++;
    if (state->phase == LOS_DRIVE)
        enter_brake(state, signals);
    return true;
}

static bool quiet_for(los_state_t *state, bool quiet, uint8_t period_ms, uint16_t needed_ms)
{
    const uint32_t total_ms = (uint32_t)state->quiet_ms + period_ms;
    state->quiet_ms = quiet ? (uint16_t)total_ms : 0;
    return quiet && total_ms >= needed_ms;
}

static void brake(const los_config_t *config, los_state_t *state, const sight_t *sight, const signals_state_t *signals,
                  uint8_t period_ms)
{
    const bool at_rest = fix_abs_u16(signals->speed_mm_s_q4) <= config->rest_speed_mm_s_q4;
    state->bearing_bam16 = sight->bearing_bam16;
    if (!quiet_for(state, at_rest, period_ms, config->rest_ms))
        return;
    if (state->last_reached)
        end(state, LOS_ARRIVED);
    else
        enter(state, LOS_TURN);
}

static void turn(const los_config_t *config, los_state_t *state, const sight_t *sight, const signals_state_t *signals,
                 uint8_t period_ms)
{
    const bool aligned = heading_error_bam16(state, signals) <= config->align_bam16;
    const bool still = fix_abs_u16(signals->yaw_rate_mrad_s) <= config->rest_yaw_rate_mrad_s;
    if (quiet_for(state, aligned && still, period_ms, config->settle_ms))
        enter_drive(state, sight);
}

static void move(const los_config_t *config, los_state_t *state, const sight_t *sight, const signals_state_t *signals,
                 uint8_t period_ms)
{
    if (state->phase == LOS_BRAKE) {
        brake(config, state, sight, signals, period_ms);
        return;
    }
    if (beyond(sight, config->bearing_hold_mm))
        state->bearing_bam16 = sight->bearing_bam16;
    if (state->phase == LOS_TURN)
        turn(config, state, sight, signals, period_ms);
    else if (heading_error_bam16(state, signals) > config->pivot_bam16)
        enter_brake(state, signals);
}

/* The speed from which the robot can still brake: the square root of 2 decel distance. */
static int16_t approach_speed_mm_s_q4(const los_config_t *config, const sight_t *sight)
{
    const uint32_t squared_mm2_s2 = fix_mul_u16(config->decel_mm_s2, fix_sqrt_u32(sight->distance_squared_mm2)) << 1;
    const uint16_t cruise = (uint16_t)config->cruise_mm_s_q4;
    if (squared_mm2_s2 >= (1UL << 24) || squared_mm2_s2 << 8 >= fix_mul_u16(cruise, cruise))
        return config->cruise_mm_s_q4;
    const uint16_t braking_q4 = fix_sqrt_u32(squared_mm2_s2 << 8);
    return braking_q4 > (uint16_t)config->creep_mm_s_q4 ? (int16_t)braking_q4 : config->creep_mm_s_q4;
}

static void report(const los_config_t *config, const los_state_t *state, const sight_t *sight,
                   const signals_state_t *signals, los_output_t *output)
{
    output->demand.drive = state->phase != LOS_END;
    output->demand.speed_mm_s_q4 = state->phase == LOS_DRIVE ? approach_speed_mm_s_q4(config, sight) : 0;
    output->demand.heading_bam16 = state->phase == LOS_BRAKE ? state->hold_heading_bam16 : state->bearing_bam16;
    output->status = state->status;
    output->phase = state->phase;
    output->waypoint = state->waypoint;
    output->cross_track_mm = left_mm(sight, &state->leg);
    output->heading_error_bam16 = fix_angle_diff_bam16(state->bearing_bam16, signals->heading_bam16);
    output->overshoots = state->overshoots;
    output->skipped = state->skipped;
    output->leg_ms = state->leg_ms;
}

static void steer_leg(const los_config_t *config, const route_t *route, los_state_t *state, sight_t *sight,
                      const signals_state_t *signals, uint8_t period_ms)
{
    state->leg_ms += period_ms;
    if (state->leg_ms > config->leg_timeout_ms)
        fail(config, route, state, sight, signals, LOS_TIMED_OUT);
    else if (state->last_reached)
        brake(config, state, sight, signals, period_ms);
    else if (sight->distance_squared_mm2 <= fix_mul_u16(config->acceptance_mm, config->acceptance_mm))
        reach(config, route, state, sight, signals);
    else if (overshoots(config, state, sight, signals) && state->leg_overshoots > config->max_overshoots)
        fail(config, route, state, sight, signals, LOS_OVERSHOT);
    else
        move(config, state, sight, signals, period_ms);
}

void los_reset(los_state_t *state)
{
    state->phase = LOS_BEGIN;
    state->status = LOS_UNDERWAY;
    state->waypoint = 0;
    state->last_reached = false;
    state->hold_heading_bam16 = 0;
    state->overshoots = 0;
    state->skipped = 0;
}

void los_step(const los_config_t *config, const route_t *route, los_state_t *state, const signals_state_t *signals,
              uint8_t period_ms, los_output_t *output)
{
    sight_t sight;
    look(&sight, &route->waypoints[state->waypoint], signals);
    if (state->phase == LOS_BEGIN) {
        look_along(&state->leg, sight.bearing_bam16);
        begin_leg(config, state, &sight, signals);
    }
    if (state->phase != LOS_END)
        steer_leg(config, route, state, &sight, signals, period_ms);
    report(config, state, &sight, signals, output);
}
