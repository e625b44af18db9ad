#include "contracts.h"
#include "core/bytes.h"
#include "core/flash.h"

/* bytes.c proves its loops; here they are one assignment of the whole. */
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
/* The CRC is any number: crc.c proves the real one, and nothing below asks which. */
#include "wire/crc.h"

static uint16_t open_crc(uint16_t crc, uint16_t number)
{
    uint16_t any;
    (void)crc;
    (void)number;
    return any;
}

#define crc_of_number open_crc
#include "app/commands.c"
#include "app/parameters.c"

static route_waypoint_t elsewhere[ROUTE_WAYPOINTS_MAX];

/* Any state of a brick: settings in their ranges, a route that is the caller's own or one of the two that a host writes. */
static void any_commands(commands_t *of)
{
    uint8_t which;
    route_waypoint_t any[ROUTE_WAYPOINTS_MAX];

    for (uint8_t i = 0; i < ROUTE_WAYPOINTS_MAX; i++)
        elsewhere[i] = any[i];
    of->route.waypoints = which == 0 ? of->waypoints[0] : which == 1 ? of->waypoints[1] : elsewhere;
    ASSUME(settings_hold(&of->parameters) && constants_hold(&of->parameters.config) && route_holds(&of->route));
    ASSUME(of->pending <= MODE_RESET);
}

static commands_t commands;
static loop_state_t loop;
static uint8_t data[MESSAGE_DATA_MAX];
static mode_command_t pending;
static mode_name_t mode;
static bool opened;
static route_t before;

/* Any state of brick and loop, and any contents of a request. */
static void any_request(void)
{
    commands_t any;
    loop_state_t any_loop;
    message_t any_message;

    commands = any;
    loop = any_loop;
    for (uint8_t i = 0; i < MESSAGE_DATA_MAX; i++)
        data[i] = any_message.data[i];
    any_commands(&commands);
    pending = commands.pending;
    opened = commands.open;
    mode = loop.step.mode.mode;
    before = commands.route;
}

static void keeps_settings(void)
{
    ASSERT(settings_hold(&commands.parameters) && constants_hold(&commands.parameters.config));
}

static void keeps_route(void)
{
    ASSERT(commands.route.waypoints == before.waypoints && commands.route.count == before.count &&
           route_holds(&commands.route));
}

static void keeps_mode(void)
{
    ASSERT(commands.pending == pending && commands.open == opened && loop.step.mode.mode == mode);
}

/* A start waits for the next step only if it was asked for in IDLE. */
void commands_mode(void)
{
    any_request();
    (void)command_mode(&commands, &loop, data);
    ASSERT(commands.pending <= MODE_RESET);
    ASSERT(commands.pending != MODE_START || pending == MODE_START || mode == MODE_IDLE);
    ASSERT(commands.open == opened && loop.step.mode.mode == mode);
    keeps_route();
    keeps_settings();
    END();
}

/* Settings alone change. */
void commands_parameter(void)
{
    any_request();
    (void)parameter(&commands, &loop, data);
    keeps_mode();
    keeps_route();
    keeps_settings();
    END();
}

/* The route in force stays: a waypoint is written beside it. */
void commands_waypoint(void)
{
    uint8_t at;

    any_request();
    ASSUME(at < commands.route.count);
    const route_waypoint_t was = commands.route.waypoints[at];
    (void)waypoint(&commands, &loop, data);
    ASSERT(commands.route.waypoints[at].x_mm == was.x_mm && commands.route.waypoints[at].y_mm == was.y_mm);
    keeps_mode();
    keeps_route();
    keeps_settings();
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
