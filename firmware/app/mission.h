/* mission.h: the route that a brick flies until a host uploads another one. */
#ifndef BRICKPILOT_APP_MISSION_H
#define BRICKPILOT_APP_MISSION_H

#include "app/commands.h"

/* The eight waypoints of the paper's fig. 8, in mm. */
static const route_waypoint_t MISSION[] = {{1000, 1000}, {1000, -1000}, {0, -500},    {-1300, -700},
                                           {0, 200},     {-100, 1100},  {-300, 1500}, {1500, -1000}};

#endif
