/* contracts.h: what each stage of a step assumes of its inputs and its state, and what it guarantees. One predicate
 * serves both: the stage that makes a value asserts it, the stage that takes the value assumes it. So every output is
 * in the range for which the next stage was proved.
 *
 * A state's predicate holds for a state of zeros, and each stage keeps it (one step from any state that fulfils it). So
 * it holds after any number of steps. All else is arbitrary: an object that a proof does not initialise has any value.
 */
#ifndef PROOF_CONTRACTS_H
#define PROOF_CONTRACTS_H

#include "app/commands.h"
#include "app/settings_gen.h"
#include "ranges_gen.h" /* LEAST_ and MOST_: made from the headers' comments by ranges.py */

#define ASSUME(condition) __CPROVER_assume(condition)
#define ASSERT(condition) __CPROVER_assert(condition, #condition)
#define WITHIN(place, value) ((value) >= LEAST_##place && (value) <= MOST_##place)
#define UP_TO(most, value) ((value) >= -(most) && (value) <= (most))

/* The last statement of a proof. Compiled with -DREACHED it must fail, which shows that the assumptions can be met. */
#ifdef REACHED
#define END() __CPROVER_assert(false, "the end is reached")
#else
#define END()
#endif

/* The settings, in the ranges that firmware/app/parameters.c admits (from settings.toml, by settings_gen.h). */
#define PROOF_LOW(low, span) low,
#define PROOF_SPAN(low, span) span,
static const int16_t PROOF_LOWS[] = {SETTINGS_RANGES(PROOF_LOW)};
static const uint16_t PROOF_SPANS[] = {SETTINGS_RANGES(PROOF_SPAN)};

static bool setting_holds(uint8_t range, uint8_t size, int32_t value)
{
    return size == 4 ? value > 0
                     : value >= PROOF_LOWS[range] && value <= (int32_t)PROOF_LOWS[range] + PROOF_SPANS[range];
}

#define PROOF_SETTING(field, range, at_rest) &&setting_holds(range, sizeof of->field, (int32_t)of->field)

static bool settings_hold(const parameters_t *of)
{
    return true SETTINGS(PROOF_SETTING);
}

/* The constants that no setting changes, as the headers state them. */
static bool constants_hold(const loop_config_t *of)
{
    return WITHIN(mixer_config_t_battery_floor_mv, of->step.mixer.battery_floor_mv) &&
           WITHIN(heading_config_t_slowest_weight_bits, of->step.heading.slowest_weight_bits) &&
           WITHIN(speed_config_t_accel_gain_q15, of->step.speed.accel_gain_q15) &&
           WITHIN(speed_config_t_slowest_weight_bits, of->step.speed.slowest_weight_bits) &&
           WITHIN(speed_config_t_travel_gain_q15, of->step.speed.travel_gain_q15) &&
           WITHIN(speed_config_t_speed_gain_q15, of->step.speed.speed_gain_q15) &&
           WITHIN(speed_config_t_accel_filter_q15, of->step.speed.accel_filter_q15) &&
           WITHIN(friction_config_t_mv_per_mm_s2_q10, of->step.speed.friction.mv_per_mm_s2_q10) &&
           WITHIN(friction_config_t_half_track_m_q14, of->step.speed.friction.half_track_m_q14);
}

static bool sensors_hold(const signals_sensors_t *of)
{
    return WITHIN(signals_sensors_t_period_ms, of->period_ms);
}

#define PROOF_TRAVEL_MOST                                                                                              \
    (536870912L + 1073741824L + 2L * 20 * 65536) /* most travel: left over, counted and predicted */
#define PROOF_SWAY_MOST (20L * 65536)

static bool estimate_holds(const signals_estimate_t *of)
{
    return WITHIN(signals_estimate_t_period_ms, of->period_ms) && UP_TO(PROOF_TRAVEL_MOST, of->travel_um_q5) &&
           UP_TO(PROOF_SWAY_MOST, of->sway_travel_um_q5);
}

static bool effort_holds(const signals_effort_t *of)
{
    return WITHIN(signals_effort_t_surge_mv, of->surge_mv) && WITHIN(signals_effort_t_surge_mv, of->yaw_mv);
}

static bool route_holds(const route_t *of)
{
    if (of->count > ROUTE_WAYPOINTS_MAX)
        return false;
    for (uint8_t i = 0; i < ROUTE_WAYPOINTS_MAX; i++)
        if (i < of->count && !(WITHIN(route_waypoint_t_x_mm, of->waypoints[i].x_mm) &&
                               WITHIN(route_waypoint_t_x_mm, of->waypoints[i].y_mm)))
            return false;
    return true;
}

static bool pid_holds(
    const pid_state_t *of) /* a setting may lower limit_mv below the integral, so the bound is the largest limit_mv */
{
    return UP_TO(MOST_pid_config_t_limit_mv * 65536L, of->integral_mv_q16);
}

static bool heading_holds(const heading_state_t *of)
{
    return UP_TO(HEADING_BIAS_LIMIT_MRAD_S * 256L, of->bias.value) && of->block_steps < HEADING_BLOCK_STEPS &&
           (of->block_steps == 0 || UP_TO(32767L * of->block_steps, of->block_sum_mrad_s));
}

#define PROOF_ACCEL_MOST 1073676290L /* a jump of 2^29, twice less a 32768th, doubled */

static bool friction_holds(const friction_state_t *of)
{
    return of->learnt_mv_q4 <= FRICTION_MOST_MV * 16L && of->quiet_steps < FRICTION_REST_STEPS;
}

static bool speed_holds(const speed_state_t *of)
{
    return friction_holds(&of->friction) && UP_TO(BODY_SPEED_LIMIT_MM_S_Q17, of->speed_mm_s_q17) &&
           UP_TO(PROOF_ACCEL_MOST, of->accel_mm_s2_q8) && UP_TO(536870912L, of->residual_um_q5) &&
           UP_TO(4096000L, of->bias.value);
}

static bool signature_holds(const monitor_signature_t *of)
{
    return UP_TO(1073741824L, of->product_q12) && of->square_q12 >= 0 && of->square_q12 <= 1073741824L;
}

static bool monitor_holds(const monitor_state_t *of)
{
    bool holds = signature_holds(&of->battery) && of->jobs <= 2 * (MONITOR_SIGNATURES + 1) + 1 &&
                 UP_TO(MONITOR_MOST_SD_Q6, of->innovation_q6) && of->rank.best_q7 >= 0 && of->rank.second_q7 >= 0 &&
                 of->rank.cause <= MONITOR_SLIP && of->rank.size >= -32767;
    for (int side = 0; side < 2; side++)
        for (int i = 0; i < MONITOR_SIGNATURES; i++)
            holds = holds && signature_holds(&of->wheel[side][i]);
    for (int i = 0; i < MONITOR_SIGNATURES; i++)
        holds = holds && UP_TO(MONITOR_MOST_SD_Q6, of->signature_q6[i]);
    for (int i = 0; i < MONITOR_CHANNELS; i++)
        holds = holds && of->report[i].cause <= MONITOR_SLIP && of->quiet_blocks[i] <= MONITOR_HOLD_BLOCKS;
    return holds;
}

static bool signature_below(const monitor_signature_t *of, int16_t threshold_q5)
{
    return of->sum_q5[0] >= 0 && of->sum_q5[0] <= threshold_q5 && of->sum_q5[1] >= 0 && of->sum_q5[1] <= threshold_q5;
}

static bool monitor_below(const monitor_state_t *of, int16_t threshold_q5)
{
    bool below = signature_below(&of->battery, threshold_q5);
    for (int side = 0; side < 2; side++)
        for (int i = 0; i < MONITOR_SIGNATURES; i++)
            below = below && signature_below(&of->wheel[side][i], threshold_q5);
    return below;
}

static bool pose_holds(const pose_state_t *of)
{
    return UP_TO(31, of->x.rest_um_q5) && UP_TO(31, of->y.rest_um_q5);
}

static bool pair_holds(const fix_vector_t *of)
{
    return of->x >= -32767 && of->y >= -32767;
}

static bool los_holds(const los_state_t *of, const route_t *route)
{
    return of->waypoint < route->count && of->phase <= LOS_END && of->status <= LOS_OVERSHOT &&
           pair_holds(&of->to_mm) && pair_holds(&of->pass_q15) && pair_holds(&of->left_q15);
}

static bool mode_holds(const mode_state_t *of, const route_t *route)
{
    return of->mode <= MODE_FAULT && (of->mode == MODE_RUN || (!of->demand.drive && of->demand.speed_mm_s_q4 == 0)) &&
           (of->mode != MODE_RUN ||
            (los_holds(&of->los, route) && of->los.status == LOS_UNDERWAY && of->los.phase != LOS_END)) &&
           of->demand.speed_mm_s_q4 >= 0 && (of->mode == MODE_FAULT) == (of->fault != MODE_NO_FAULT);
}

static bool drive_holds(const signals_drive_t *of)
{
    return UP_TO(32767, of->left_mv) && UP_TO(32767, of->right_mv) && WITHIN(signals_drive_t_left_q15, of->left_q15) &&
           WITHIN(signals_drive_t_left_q15, of->right_q15);
}

static bool mixer_holds(const mixer_state_t *of)
{
    return drive_holds(&of->drive);
}

#endif
