/* commands.h: the requests of the host at the other end of the link. Pure: no HAL, no clock.
 *
 * OPEN begins a session with the constants of a profile, an empty route and no command. A host writes a new route,
 * waypoint by waypoint, into a second buffer. The new route then replaces the route in force in one step, so that the
 * robot never flies half a route. Every request gets a reply with the same sequence number. A request whose CRC is
 * wrong, or whose kind is unknown, gets no reply.
 */
#ifndef BRICKPILOT_APP_COMMANDS_H
#define BRICKPILOT_APP_COMMANDS_H

#include "app/parameters.h"
#include "wire/message.h"

typedef struct {
    parameters_t parameters;
    route_t route; /* the route in force: its waypoints are the caller's own, or are in `waypoints` */
    route_waypoint_t waypoints[2][ROUTE_WAYPOINTS_MAX]; /* one route is in force, the host writes the other */
    mode_command_t pending;                             /* the command for the next step */
    bool open;                                          /* a session is open: the reply to OPEN was ok */
    bool realtime;                                      /* the pace that OPEN asked for */
} commands_t;

/* Sets the state before any session: no route, and the constants of `coupled`, or of the only profile in the image
 * (model/body.h). */
void commands_start(commands_t *commands);

/* Carries out the request `message`, overwrites it with the reply, and returns true. Returns false, and changes
 * nothing, if `message` is no valid request. `loop` is the loop's state: a new session clears it. */
bool commands_take(commands_t *commands, loop_state_t *loop, message_t *message);

/* Returns the command for the next step, and forgets it. */
mode_command_t commands_next(commands_t *commands);

/* Returns the route that the host writes. A waypoint that the host has not written yet has COMMANDS_UNWRITTEN as its x. */
#define COMMANDS_UNWRITTEN (-32767 - 1)
route_waypoint_t *commands_written(commands_t *commands);

#endif
