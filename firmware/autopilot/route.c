#include "autopilot/route.h"

#include "core/fix.h"

route_status_t route_set(route_t *route, const route_waypoint_t *waypoints, uint8_t count)
{
    const route_waypoint_t *at = waypoints;
    uint8_t left = count;

    if (count == 0)
        return ROUTE_EMPTY;
    if (count > ROUTE_WAYPOINTS_MAX)
        return ROUTE_TOO_LONG;
    do {
        if (fix_abs_u16(at->x_mm) > ROUTE_COORDINATE_MAX_MM || fix_abs_u16(at->y_mm) > ROUTE_COORDINATE_MAX_MM)
            return ROUTE_TOO_FAR;
        if (left != count && at->x_mm == at[-1].x_mm && at->y_mm == at[-1].y_mm)
            return ROUTE_REPEATED;
        at++;
    } while (--left > 0);
    route->waypoints = waypoints;
    route->count = count;
    return ROUTE_OK;
}
