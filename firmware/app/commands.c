#include "app/commands.h"

#include <stddef.h>

#include "app/params_gen.h"
#include "core/bytes.h"
#include "core/fix.h"
#include "wire/check.h"
#include "wire/codecs_gen.h"

/* Beside route_status_t, in ROUTE. */
enum {
    ROUTE_BUSY = WIRE_ROUTE_STATUS_BUSY_CHOICE,
    ROUTE_INCOMPLETE = WIRE_ROUTE_STATUS_INCOMPLETE_CHOICE,
    ROUTE_DIFFERS = WIRE_ROUTE_STATUS_DIFFERS_CHOICE
};

#ifdef BODY_ONLY
enum { FIRST_PROFILE = BODY_ONLY };
#else
enum { FIRST_PROFILE = BODY_COUPLED };
#endif

/* NULL for a profile that is not in this image. */
static const loop_config_t *constants_of(uint8_t profile)
{
#ifndef BODY_WITHOUT_COUPLED
    if (profile == BODY_COUPLED)
        return &PARAMS_COUPLED;
#endif
#ifndef BODY_WITHOUT_PAPER
    if (profile == BODY_PAPER)
        return &PARAMS_PAPER;
#endif
    return NULL;
}

route_waypoint_t *commands_written(commands_t *commands)
{
    return commands->waypoints[commands->route.waypoints == commands->waypoints[0] ? 1 : 0];
}

static void forget_written(commands_t *commands)
{
    route_waypoint_t *waypoint = commands_written(commands);

    for (uint8_t left = ROUTE_WAYPOINTS_MAX; left > 0; left--)
        (waypoint++)->x_mm = COMMANDS_UNWRITTEN;
}

static void start(commands_t *commands, const loop_config_t *constants)
{
    bytes_clear(commands, sizeof *commands);
    parameters_start(&commands->parameters, constants);
    forget_written(commands);
}

void commands_start(commands_t *commands)
{
    start(commands, constants_of(FIRST_PROFILE));
}

mode_command_t commands_next(commands_t *commands)
{
    const mode_command_t command = commands->pending;
    commands->pending = MODE_NONE;
    return command;
}

static commands_result_t open_session(commands_t *commands, uint8_t *data)
{
    const loop_config_t *const constants = constants_of(data[WIRE_OPEN_PROFILE_AT]);
    const uint8_t pace = data[WIRE_OPEN_PACE_AT];
    uint8_t status = WIRE_HELLO_STATUS_OK_CHOICE;

    if (data[WIRE_OPEN_PROTOCOL_AT] != WIRE_PROTOCOL)
        status = WIRE_HELLO_STATUS_PROTOCOL_DIFFERS_CHOICE;
    else if (message_get(&data[WIRE_OPEN_DBC_AT]) != WIRE_DBC)
        status = WIRE_HELLO_STATUS_DBC_DIFFERS_CHOICE;
    else if (constants == NULL)
        status = WIRE_HELLO_STATUS_NO_SUCH_PROFILE_CHOICE;
    else if (pace > WIRE_OPEN_PACE_REALTIME_CHOICE)
        status = WIRE_HELLO_STATUS_NO_SUCH_PACE_CHOICE;
    data[WIRE_HELLO_PROTOCOL_AT] = WIRE_PROTOCOL;
    message_put(&data[WIRE_HELLO_DBC_AT], WIRE_DBC);
    data[WIRE_HELLO_STATUS_AT] = status;
    if (status != WIRE_HELLO_STATUS_OK_CHOICE)
        return COMMANDS_ANSWERED;
    start(commands, constants);
    commands->open = true;
    commands->realtime = pace;
    return COMMANDS_OPENED;
}

/* Whether the diagram of mode.h has an arrow for it. */
static bool leads_on(mode_name_t mode, uint8_t command)
{
    if (command == MODE_START)
        return mode == MODE_IDLE;
    return (mode == MODE_RUN) == (command == MODE_ABORT);
}

static uint8_t set_mode(commands_t *commands, mode_name_t mode, uint8_t command)
{
    if (command < MODE_START || command > MODE_RESET)
        return PARAMETERS_UNKNOWN;
    if (!leads_on(mode, command))
        return PARAMETERS_RANGE;
    commands->pending = (mode_command_t)command;
    return PARAMETERS_OK;
}

/* Puts the reply in the request's place. */
typedef void request_t(commands_t *commands, const mode_state_t *mode, uint8_t *data);

static void command_mode(commands_t *commands, const mode_state_t *mode, uint8_t *data)
{
    data[WIRE_MODE_REPLY_STATUS_AT] = set_mode(commands, mode->mode, data[WIRE_MODE_COMMAND_COMMAND_AT]);
    data[WIRE_MODE_REPLY_MODE_AT] = (uint8_t)(mode->mode | mode->fault << WIRE_MODE_REPLY_FAULT_SHIFT);
    message_put(&data[WIRE_MODE_REPLY_STATUS_AT + 1], 0);
}

static bool running(const commands_t *commands, const mode_state_t *mode)
{
    return mode->mode == MODE_RUN || commands->pending == MODE_START;
}

/* The other three requests have in common: a number, and whether to write. */
static uint8_t number_of(const uint8_t *data)
{
    return data[WIRE_PARAMETER_REQUEST_PARAMETER_AT] & WIRE_PARAMETER_REQUEST_PARAMETER_MASK;
}

static bool writes(const uint8_t *data)
{
    return (data[WIRE_PARAMETER_REQUEST_WRITE_AT] & 1U << WIRE_PARAMETER_REQUEST_WRITE_SHIFT) != 0;
}

/* Two of their replies: the number, and a status in its byte. */
static void put_status(uint8_t *data, uint8_t status)
{
    uint8_t *const at = &data[WIRE_PARAMETER_STATUS_AT];

    *at = (uint8_t)(number_of(data) | (uint8_t)(status << WIRE_PARAMETER_STATUS_SHIFT));
}

static void parameter(commands_t *commands, const mode_state_t *mode, uint8_t *data)
{
    uint8_t *const value = &data[WIRE_PARAMETER_VALUE_AT];
    const uint8_t number = number_of(data);
    parameters_status_t status = PARAMETERS_OK;

    if (writes(data)) {
        if (parameters_of_robot(number) && running(commands, mode))
            status = PARAMETERS_BUSY;
        else
            status = parameters_write(&commands->parameters, number, value);
    }
    if (parameters_read(&commands->parameters, number, value) != PARAMETERS_OK)
        status = PARAMETERS_UNKNOWN;
    put_status(data, (uint8_t)status);
}

/* A waypoint out of WAYPOINT_REQUEST, or into WAYPOINT and what a route's check is made of. */
static void move_waypoint(void *to, const void *from)
{
    message_move(to, from, sizeof(int16_t));
    message_move((uint8_t *)to + sizeof(int16_t), (const uint8_t *)from + sizeof(int16_t), sizeof(int16_t));
}

static bool too_far(const uint8_t *at)
{
    return fix_abs_u16((int16_t)message_get(at)) > ROUTE_COORDINATE_MAX_MM;
}

static uint8_t write_waypoint(commands_t *commands, uint8_t index, const uint8_t *from)
{
    if (index >= ROUTE_WAYPOINTS_MAX)
        return PARAMETERS_UNKNOWN;
    if (too_far(from) || too_far(from + sizeof(int16_t)))
        return PARAMETERS_RANGE;
    move_waypoint(&commands_written(commands)[index], from);
    return PARAMETERS_OK;
}

static uint8_t read_waypoint(const route_t *route, uint8_t index, uint8_t *to)
{
    if (index >= route->count)
        return PARAMETERS_UNKNOWN;
    move_waypoint(to, &route->waypoints[index]);
    return PARAMETERS_OK;
}

static void waypoint(commands_t *commands, const mode_state_t *mode, uint8_t *data)
{
    uint8_t *const at = &data[WIRE_WAYPOINT_X_AT];
    const uint8_t index = number_of(data);

    (void)mode;
    put_status(data, writes(data) ? write_waypoint(commands, index, at) : read_waypoint(&commands->route, index, at));
}

static uint16_t check_of_route(const route_waypoint_t *waypoints, uint8_t count)
{
    uint16_t crc = CHECK_START;
    uint8_t bytes[4];

    for (; count > 0; count--) {
        move_waypoint(bytes, waypoints++);
        crc = check_crc16(crc, bytes, sizeof bytes);
    }
    return crc;
}

static uint16_t check_in_force(const commands_t *commands)
{
    return check_of_route(commands->route.waypoints, commands->route.count);
}

static uint8_t set_route(commands_t *commands, bool running, uint8_t count, uint16_t check)
{
    const route_waypoint_t *const written = commands_written(commands);
    route_status_t status;

    if (count > 0 && count == commands->route.count && check == check_in_force(commands))
        return ROUTE_OK; /* asked again: the answer was lost */
    if (running)
        return ROUTE_BUSY;
    if (count > ROUTE_WAYPOINTS_MAX)
        return ROUTE_TOO_LONG;
    for (uint8_t i = 0; i < count; i++)
        if (written[i].x_mm == COMMANDS_UNWRITTEN)
            return ROUTE_INCOMPLETE;
    if (check_of_route(written, count) != check)
        return ROUTE_DIFFERS;
    status = route_set(&commands->route, written, count);
    if (status == ROUTE_OK)
        forget_written(commands);
    return (uint8_t)status;
}

static void route(commands_t *commands, const mode_state_t *mode, uint8_t *data)
{
    uint8_t *const check = &data[WIRE_ROUTE_ROUTE_CHECK_AT];
    uint8_t status = ROUTE_OK;

    if (writes(data))
        status = set_route(commands, running(commands, mode), number_of(data), message_get(check));
    data[WIRE_ROUTE_COUNT_AT] = commands->route.count;
    message_put(check, check_in_force(commands));
    message_put(&data[WIRE_ROUTE_STATUS_AT], status); /* and nothing in the byte behind it */
}

/* Of an open session. */
static const struct {
    uint16_t id;
    request_t *take;
} REQUESTS[] = {{WIRE_MODE_COMMAND_FRAME_ID, command_mode},
                {WIRE_PARAMETER_REQUEST_FRAME_ID, parameter},
                {WIRE_WAYPOINT_REQUEST_FRAME_ID, waypoint},
                {WIRE_ROUTE_REQUEST_FRAME_ID, route}};
enum { REQUESTS_COUNT = sizeof REQUESTS / sizeof REQUESTS[0] };

static commands_result_t obey(commands_t *commands, const mode_state_t *mode, message_t *message)
{
    if (message->id == WIRE_OPEN_FRAME_ID)
        return open_session(commands, message->data);
    if (commands->open)
        for (uint8_t i = 0; i < REQUESTS_COUNT; i++)
            if (message->id == REQUESTS[i].id) {
                REQUESTS[i].take(commands, mode, message->data);
                return COMMANDS_ANSWERED;
            }
    return COMMANDS_NOTHING;
}

commands_result_t commands_take(commands_t *commands, const mode_state_t *mode, message_t *message)
{
    commands_result_t result;

    if (!check_holds(message)) {
        commands->refused = fix_count_u16(commands->refused);
        return COMMANDS_NOTHING;
    }
    result = obey(commands, mode, message);
    if (result != COMMANDS_NOTHING) {
        message->id++; /* in the DBC every reply comes behind its request */
        check_seal(message);
    }
    return result;
}
