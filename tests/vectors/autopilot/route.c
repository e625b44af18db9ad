#include "autopilot/route.h"

#include "vectors.h"

enum { HELD = 64 };

/* Routes out of a ring of waypoints of which one changes each time: good ones, too long ones, far and repeated points. */
void vectors_feed(void)
{
    static route_waypoint_t ring[HELD];
    static uint8_t at;
    static route_t route;
    const uint8_t first = (uint8_t)(draw_u16() & 31U);
    const uint8_t count = (uint8_t)(draw_rarely(5) ? draw_up_to(255) : draw_u16() & 31U);

    ring[at].x_mm = draw_rarely(8) ? draw_s16() : draw_between(-ROUTE_COORDINATE_MAX_MM, ROUTE_COORDINATE_MAX_MM);
    ring[at].y_mm = draw_rarely(8) ? draw_s16() : draw_between(-ROUTE_COORDINATE_MAX_MM, ROUTE_COORDINATE_MAX_MM);
    at = (uint8_t)((at + 1) & (HELD - 1));
    hash_u8((uint8_t)route_set(&route, &ring[first], count));
    hash_u8(route.count);
    hash_u8(route.waypoints != 0 ? (uint8_t)(route.waypoints - ring) : 255);
}
