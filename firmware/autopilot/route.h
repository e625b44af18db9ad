/* route.h: the waypoints of a mission. route_set() checks them once. */
#ifndef BRICKPILOT_AUTOPILOT_ROUTE_H
#define BRICKPILOT_AUTOPILOT_ROUTE_H

#include <stdint.h>

/* Largest number of waypoints that a host may write: a build constant, 1..32. RAM holds two such routes. */
#ifndef ROUTE_WAYPOINTS_MAX
#define ROUTE_WAYPOINTS_MAX 32
#endif

enum { ROUTE_COORDINATE_MAX_MM = 30000 };

typedef struct {
    int16_t x_mm; /* -30000..30000 */
    int16_t y_mm;
} route_waypoint_t;

/* With all fields 0 the route is empty. */
typedef struct {
    const route_waypoint_t *waypoints; /* the caller's array; must outlive the route */
    uint8_t count;                     /* 0..ROUTE_WAYPOINTS_MAX */
} route_t;

enum {
    ROUTE_OK = 0,
    ROUTE_EMPTY = 1,
    ROUTE_TOO_LONG = 2, /* more than ROUTE_WAYPOINTS_MAX */
    ROUTE_TOO_FAR = 3,  /* a coordinate beyond ROUTE_COORDINATE_MAX_MM */
    ROUTE_REPEATED = 4  /* a waypoint equals the previous one: the leg has no direction */
};
typedef uint8_t route_status_t;

/* Checks the waypoints. Sets `route` only if it returns ROUTE_OK. */
route_status_t route_set(route_t *route, const route_waypoint_t *waypoints, uint8_t count);

#endif
