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
#include "app/commands.c"
#include "app/parameters.c"

static route_waypoint_t elsewhere[ROUTE_WAYPOINTS_MAX];

/* Any state of a brick: settings in their ranges, a route that is the caller's own or one of the two that a host writes. */
static void any_commands(commands_t *commands)
{
    uint8_t which;
    route_waypoint_t any[ROUTE_WAYPOINTS_MAX];

    for (uint8_t i = 0; i < ROUTE_WAYPOINTS_MAX; i++)
        elsewhere[i] = any[i];
    commands->route.waypoints = which == 0 ? commands->waypoints[0] : which == 1 ? commands->waypoints[1] : elsewhere;
    ASSUME(settings_hold(&commands->parameters) && constants_hold(&commands->parameters.config) &&
           route_holds(&commands->route));
    ASSUME(commands->pending <= MODE_RESET);
}

void commands_take_safe(void)
{
    commands_t commands;
    loop_state_t loop;
    message_t message;

    any_commands(&commands);
    const uint16_t asked = message.id;
    const bool open = commands.open, runs = loop.step.mode.mode == MODE_RUN || commands.pending == MODE_START;
    const route_t route = commands.route;
    const bool taken = commands_take(&commands, &loop, &message);
    ASSERT(settings_hold(&commands.parameters) && constants_hold(&commands.parameters.config));
    ASSERT(route_holds(&commands.route) && commands.pending <= MODE_RESET);
    /* Before OPEN nothing is obeyed; the route of a robot that drives stays, but for OPEN, which clears the loop's state and so stops the motors. */
    ASSERT(!taken || open || asked == WIRE_OPEN_FRAME_ID);
    ASSERT(!runs || asked == WIRE_OPEN_FRAME_ID ||
           (commands.route.waypoints == route.waypoints && commands.route.count == route.count));
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
