#include "contracts.h"
#include "autopilot/mode.c"

static bool called;
static int16_t most_mm_s_q4;

/* What the harness los.c proves of the real functions. */
void los_reset(los_state_t *los)
{
    los_state_t zero = {0};
    *los = zero;
}

void los_step(const los_config_t *config, const route_t *route, los_state_t *los, const signals_estimate_t *estimate,
              signals_demand_t *demand)
{
    los_state_t after;
    int16_t speed_mm_s_q4;
    uint16_t heading_bam16;

    ASSERT(los_holds(los, route) && los->phase != LOS_END &&
           WITHIN(signals_estimate_t_period_ms, estimate->period_ms) && estimate->valid);
    ASSUME(los_holds(&after, route) && (after.status == LOS_UNDERWAY) == (after.phase != LOS_END));
    ASSUME(speed_mm_s_q4 >= 0 && speed_mm_s_q4 <= config->cruise_mm_s_q4);
    *los = after;
    demand->speed_mm_s_q4 = speed_mm_s_q4;
    demand->heading_bam16 = heading_bam16;
    most_mm_s_q4 = config->cruise_mm_s_q4;
    called = true;
}

void mode_safe(void)
{
    parameters_t parameters;
    route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX];
    route_t route;
    mode_state_t state, before;
    signals_estimate_t estimate;
    mode_command_t command;
    signals_demand_t demand;

    route.waypoints = waypoints;
    ASSUME(settings_hold(&parameters) && route_holds(&route) && mode_holds(&state, &route));
    ASSUME(WITHIN(signals_estimate_t_period_ms, estimate.period_ms));
    before = state;
    mode_step(&parameters.config.step.mode, &route, &state, &estimate, command, &demand);
    ASSERT(mode_holds(&state, &route));
    ASSERT(demand.drive == state.demand.drive && demand.speed_mm_s_q4 == state.demand.speed_mm_s_q4);
    /* The motors are off in every mode but RUN. */
    ASSERT(state.mode == MODE_RUN || (!demand.drive && demand.speed_mm_s_q4 == 0));
    /* Only a reset leaves FAULT, and leads to IDLE. */
    ASSERT(before.mode != MODE_FAULT || state.mode == MODE_FAULT || (command == MODE_RESET && state.mode == MODE_IDLE));
    /* RUN begins only in IDLE, by a start. */
    ASSERT(state.mode != MODE_RUN || before.mode == MODE_RUN || (before.mode == MODE_IDLE && command == MODE_START));
    /* A demand is either new and at most cruise, or it is that of the step before. */
    ASSERT(!called || demand.speed_mm_s_q4 <= most_mm_s_q4);
    ASSERT(called || !demand.drive || (before.demand.drive && demand.speed_mm_s_q4 == before.demand.speed_mm_s_q4));
    END();
}
