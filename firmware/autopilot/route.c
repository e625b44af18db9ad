#include "autopilot/route.h"

#include "core/fix.h"

static route_status_t check(const route_waypoint_t *waypoints, uint8_t count)
{
    if (count == 0)
        return ROUTE_EMPTY;
    if (count > ROUTE_WAYPOINTS_MAX)
        return ROUTE_TOO_LONG;
    for (uint8_t i = 0; i < count; i++) {
        const route_waypoint_t *here = &waypoints[i];
        if (fix_abs_u16(here->x_mm) > ROUTE_COORDINATE_MAX_MM || fix_abs_u16(here->y_mm) > ROUTE_COORDINATE_MAX_MM)
            return ROUTE_TOO_FAR;
        if (i > 0 && here->x_mm == waypoints[i - 1].x_mm && here->y_mm == waypoints[i - 1].y_mm)
            return ROUTE_REPEATED;
    }
    return ROUTE_OK;
}

route_status_t route_set(route_t *route, const route_waypoint_t *waypoints, uint8_t count)
{
    const route_status_t status = check(waypoints, count);
    if (status == ROUTE_OK) {
        route->waypoints = waypoints;
        route->count = count;
    }
    return status;
}
