/* commands.h: what the host at the other end of the link may ask for. Pure: no HAL, no clock.
 *
 * OPEN begins a session with the constants of a profile, an empty route and nothing pending. A mission is written waypoint by
 * waypoint beside the one in force and takes its place at once, so that half a route is never flown. Every request is
 * answered under its own sequence number; one whose check fails, or of an unknown kind, is not.
 */
#ifndef BRICKPILOT_APP_COMMANDS_H
#define BRICKPILOT_APP_COMMANDS_H

#include "app/parameters.h"
#include "wire/message.h"

typedef struct {
    parameters_t parameters;
    route_t route; /* in force: its waypoints are the caller's own, or lie in `waypoints` */
    route_waypoint_t waypoints[2][ROUTE_WAYPOINTS_MAX]; /* one is in force, the other being written */
    mode_command_t pending;                             /* for the next step */
    bool open;                                          /* since OPEN was answered with ok */
    bool realtime;                                      /* as OPEN asked */
} commands_t;

/* As before any session: no route, the constants of `coupled`, or of the profile that the image holds (model/body.h). */
void commands_start(commands_t *commands);

/* Does what `message` asks for, and makes the reply of it: true. False: no valid request, and nothing is changed. `loop` is the loop's, of
 * which a new session makes one that has not started. */
bool commands_take(commands_t *commands, loop_state_t *loop, message_t *message);

/* The command for the coming step; it is forgotten with that. */
mode_command_t commands_next(commands_t *commands);

/* The route that is being written. A waypoint that has not been since the last one in force has COMMANDS_UNWRITTEN as its x. */
#define COMMANDS_UNWRITTEN (-32767 - 1)
route_waypoint_t *commands_written(commands_t *commands);

#endif
