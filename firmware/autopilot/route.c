#include "autopilot/route.h"

#include "core/fix.h"

route_status_t route_check(const route_waypoint_t *waypoints, uint8_t count)
{
    const route_waypoint_t *const end = waypoints + count;
    if (count == 0)
        return ROUTE_EMPTY;
    if (count > ROUTE_WAYPOINTS_MAX)
        return ROUTE_TOO_LONG;
    for (;;) {
        if (fix_abs_u16(waypoints->x_mm) > ROUTE_COORDINATE_MAX_MM ||
            fix_abs_u16(waypoints->y_mm) > ROUTE_COORDINATE_MAX_MM)
            return ROUTE_TOO_FAR;
        waypoints++;
        if (waypoints == end)
            return ROUTE_OK;
        if (waypoints->x_mm == waypoints[-1].x_mm && waypoints->y_mm == waypoints[-1].y_mm)
            return ROUTE_REPEATED;
    }
}

route_status_t route_set(route_t *route, const route_waypoint_t *waypoints, uint8_t count)
{
    const route_status_t status = route_check(waypoints, count);
    if (status == ROUTE_OK) {
        route->waypoints = waypoints;
        route->count = count;
    }
    return status;
}
