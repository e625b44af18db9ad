#include "contracts.h"
#include "core/bytes.h"
#include "core/flash.h"

/* bytes.c proves the loops; here each loop is one assignment of all its bytes. */
static void open_copy(void *to, const void *from, uint16_t size)
{
    uint8_t copy[size];
    __CPROVER_array_copy(copy, (const uint8_t *)from);
    __CPROVER_array_replace((uint8_t *)to, copy);
}

static void open_clear(void *what, uint16_t size)
{
    uint8_t zero[size];
    __CPROVER_array_set(zero, 0);
    __CPROVER_array_replace((uint8_t *)what, zero);
}
#undef bytes_copy_flash
#define bytes_copy_flash open_copy
#define bytes_clear open_clear

/* The CRC is any number: crc.c proves the real CRC, and no proof below depends on its value. */
#include "wire/crc.h"

static uint16_t open_crc(uint16_t crc, uint16_t number)
{
    uint16_t any;
    (void)crc;
    (void)number;
    return any;
}

#define crc_of_number open_crc

/* So is a message's CRC: it may hold or not, and a seal is any number. An `unknown` message's CRC is never checked. */
static bool held, unknown;

static bool open_holds(const message_t *message)
{
    bool any;

    if (unknown) {
        ASSERT(!unknown);
        return false;
    }
    ASSUME(!any || message->size == MESSAGE_DATA_MAX);
    held = any;
    return any;
}

static void open_seal(message_t *message)
{
    uint16_t any;
    message_put(&message->data[CRC_AT], any);
}

#define crc_holds open_holds
#define crc_seal open_seal

/* The waypoint that the proof looks at. It may be any waypoint, so what holds of it holds of all. */
static uint8_t place;

static bool waypoint_holds(const route_t *of)
{
    return place >= of->count || (WITHIN(route_waypoint_t_x_mm, of->waypoints[place].x_mm) &&
                                  WITHIN(route_waypoint_t_x_mm, of->waypoints[place].y_mm));
}

/* What route_set_safe() in los.c proves of the real function. A proof looks at one outcome, `accepts`: with a known
 * status the solver knows which route is in force. */
static bool accepts;

static route_status_t open_route_set(route_t *route, const route_waypoint_t *waypoints, uint8_t count)
{
    if (!accepts)
        return ROUTE_REPEATED; /* for any refusal: the status goes into the reply, and nothing else depends on it */
    route->waypoints = waypoints;
    route->count = count;
    ASSUME(count > 0 && count <= ROUTE_WAYPOINTS_MAX && waypoint_holds(route));
    return ROUTE_OK;
}

#define route_set open_route_set
#include "app/commands.c"
#include "app/parameters.c"

static struct {
    route_waypoint_t own[ROUTE_WAYPOINTS_MAX];
} elsewhere;
static commands_t commands;
static loop_state_t loop;
static message_t message;
static mode_command_t pending;
static mode_name_t mode;
static bool opened, taken;
static route_t before;
static route_waypoint_t was;

/* Any state of a brick: settings in their ranges, and a route in force: one of the two that a host writes, or that of
 * the caller. If a proof names the route, the solver saves the time to tell them apart. */
enum { FIRST, SECOND, OWN, ANY };

static void any_brick(uint8_t in_force)
{
    uint8_t any_route;
    const uint8_t which = in_force == ANY ? any_route : in_force;
    commands_t any;
    loop_state_t any_loop;
    __typeof__(elsewhere) any_own;
    uint8_t any_place;

    elsewhere = any_own;
    commands = any;
    loop = any_loop;
    place = any_place;
    commands.route.waypoints = which == FIRST    ? commands.waypoints[0]
                               : which == SECOND ? commands.waypoints[1]
                                                 : elsewhere.own;
    ASSUME(settings_hold(&commands.parameters) && constants_hold(&commands.parameters.config));
    ASSUME(commands.route.count <= ROUTE_WAYPOINTS_MAX && commands.pending <= MODE_RESET);
    ASSUME(place < ROUTE_WAYPOINTS_MAX && waypoint_holds(&commands.route));
}

/* Takes any message of this kind in any such state. A message is taken if its CRC holds and a session is open, or if it
 * opens a session; any other changes nothing. */
static void take(uint16_t id, uint8_t in_force)
{
    message_t any;

    any_brick(in_force);
    message = any;
    message.id = id;
    pending = commands.pending;
    opened = commands.open;
    mode = loop.step.mode.mode;
    before = commands.route;
    was = before.waypoints[place];
    held = false;
    taken = commands_take(&commands, &loop, &message);
    ASSERT(!taken || (held && message.id == id + 1 && (opened || id == WIRE_OPEN_FRAME_ID)));
    ASSERT(message.size == any.size && message.data[0] == any.data[0]);
    ASSERT(settings_hold(&commands.parameters) && constants_hold(&commands.parameters.config));
    ASSERT(commands.pending <= MODE_RESET && commands.route.count <= ROUTE_WAYPOINTS_MAX &&
           waypoint_holds(&commands.route));
}

static void keeps_route(void)
{
    ASSERT(commands.route.waypoints == before.waypoints && commands.route.count == before.count);
    ASSERT(before.waypoints[place].x_mm == was.x_mm && before.waypoints[place].y_mm == was.y_mm);
}

static void keeps_mode(void)
{
    ASSERT(commands.pending == pending && commands.open == opened && loop.step.mode.mode == mode);
}

/* A start waits for the next step only if it was asked for in IDLE. */
void commands_mode(void)
{
    take(WIRE_MODE_COMMAND_FRAME_ID, ANY);
    ASSERT(commands.pending != MODE_START || pending == MODE_START || mode == MODE_IDLE);
    ASSERT(commands.open == opened && loop.step.mode.mode == mode);
    keeps_route();
    END();
}

/* Settings alone change. */
void commands_parameter(void)
{
    take(WIRE_PARAMETER_REQUEST_FRAME_ID, ANY);
    keeps_mode();
    keeps_route();
    END();
}

/* The route in force stays: a waypoint is written into another route. */
void commands_waypoint(void)
{
    take(WIRE_WAYPOINT_REQUEST_FRAME_ID, ANY);
    keeps_mode();
    keeps_route();
    END();
}

/* A new session begins in IDLE without a route or a command; an OPEN that is refused changes nothing. */
void commands_open(void)
{
    take(WIRE_OPEN_FRAME_ID, ANY);
    if (taken && message.data[WIRE_HELLO_STATUS_AT] == WIRE_HELLO_STATUS_OK_CHOICE) {
        ASSERT(commands.open && commands.pending == MODE_NONE && commands.route.count == 0);
        ASSERT(loop.step.mode.mode == MODE_IDLE && !loop.started);
    } else {
        keeps_mode();
        keeps_route();
    }
    END();
}

/* A route changes only if the robot does not drive and is not about to; all waypoints of the new route are in range. */
static void take_route(uint8_t in_force)
{
    take(WIRE_ROUTE_REQUEST_FRAME_ID, in_force);
    keeps_mode();
    if (!accepts || !taken || mode == MODE_RUN || pending == MODE_START)
        keeps_route();
    END();
}

void commands_route_first(void)
{
    accepts = true;
    take_route(FIRST);
}

void commands_route_second(void)
{
    accepts = true;
    take_route(SECOND);
}

void commands_route_own(void)
{
    accepts = true;
    take_route(OWN);
}

void commands_refused_first(void)
{
    take_route(FIRST);
}

void commands_refused_second(void)
{
    take_route(SECOND);
}

void commands_refused_own(void)
{
    take_route(OWN);
}

/* A message of another kind is not taken, and changes nothing. */
void commands_other(void)
{
    uint16_t id;

    ASSUME(id != WIRE_OPEN_FRAME_ID && id != WIRE_MODE_COMMAND_FRAME_ID && id != WIRE_PARAMETER_REQUEST_FRAME_ID &&
           id != WIRE_WAYPOINT_REQUEST_FRAME_ID && id != WIRE_ROUTE_REQUEST_FRAME_ID);
    unknown = true;
    take(id, ANY);
    ASSERT(!taken && message.id == id);
    keeps_mode();
    keeps_route();
    END();
}

void commands_start_holds(void)
{
    commands_t commands;

    commands_start(&commands);
    ASSERT(settings_hold(&commands.parameters) && constants_hold(&commands.parameters.config));
    ASSERT(route_holds(&commands.route) && commands.route.count == 0 && !commands.open &&
           commands.pending == MODE_NONE);
    END();
}

void parameters_write_keeps(void)
{
    parameters_t parameters;
    uint8_t number;
    int32_t value;
    bool running;

    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config));
    const parameters_status_t status = parameters_write(&parameters, number, value, running);
    ASSERT(settings_hold(&parameters) && constants_hold(&parameters.config));
    ASSERT(number < SETTINGS_COUNT || status == PARAMETERS_UNKNOWN);
    (void)parameters_read(&parameters, number);
    END();
}
