#include "abstract.h"
#include "core/trig.h"

/* What trig.c and exhaustive.c show of these functions. */
static uint16_t open_root(uint32_t value)
{
    uint16_t any;
    (void)value;
    return any;
}

#define trig_cos_q15 open_cosine
#define trig_sin_q15 open_cosine
#define trig_atan2_bam16 open_angle
#define fix_sqrt_u32 open_root
#include "autopilot/los.c"

void los_safe(void)
{
    parameters_t parameters;
    const los_config_t *const config = &parameters.config.step.mode.los;
    route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX];
    route_t route;
    los_state_t los;
    signals_estimate_t estimate;
    signals_demand_t demand;

    route.waypoints = waypoints;
    ASSUME(settings_hold(&parameters) && route_holds(&route) && los_holds(&los, &route));
    ASSUME(WITHIN(signals_estimate_t_period_ms, estimate.period_ms));
    ASSUME((los.status == LOS_UNDERWAY) == (los.phase != LOS_END));
    const bool drove = demand.drive;
    los_step(config, &route, &los, &estimate, &demand);
    ASSERT(los_holds(&los, &route));
    ASSERT((los.status == LOS_UNDERWAY) == (los.phase != LOS_END));
    /* The demand is at most cruise, and nothing but DRIVE demands a speed. */
    ASSERT(demand.speed_mm_s_q4 >= 0 && demand.speed_mm_s_q4 <= config->cruise_mm_s_q4);
    ASSERT(demand.speed_mm_s_q4 == 0 || los.phase == LOS_DRIVE);
    ASSERT(demand.drive == drove);
    END();
}

void los_begins(void)
{
    route_t route;
    los_state_t los;

    ASSUME(route.count > 0);
    los_reset(&los);
    ASSERT(los_holds(&los, &route) && los.status == LOS_UNDERWAY && los.phase != LOS_END);
    END();
}

void route_set_safe(void)
{
    route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX], elsewhere[ROUTE_WAYPOINTS_MAX];
    route_t route;
    uint8_t count;

    route.waypoints = elsewhere;
    const uint8_t before = route.count;
    const route_status_t status = route_set(&route, waypoints, count);
    if (status == ROUTE_OK)
        ASSERT(route.waypoints == waypoints && route.count == count && count > 0 && route_holds(&route));
    else
        ASSERT(route.waypoints == elsewhere && route.count == before);
    END();
}
