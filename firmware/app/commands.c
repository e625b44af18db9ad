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
static const loop_config_t *constants(uint8_t profile)
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

void commands_start(commands_t *commands)
{
    bytes_clear(commands, sizeof *commands);
    parameters_start(&commands->parameters, constants(FIRST_PROFILE));
}

mode_command_t commands_next(commands_t *commands)
{
    const mode_command_t command = commands->pending;
    commands->pending = MODE_NONE;
    return command;
}

static void name(message_t *reply, uint16_t id)
{
    reply->id = id;
    reply->size = MESSAGE_DATA_MAX;
}

static commands_result_t open_session(commands_t *commands, const message_t *message, message_t *reply)
{
    struct wire_open_t asked;
    struct wire_hello_t hello;

    (void)wire_open_unpack(&asked, message->data, MESSAGE_DATA_MAX);
    hello.sequence = asked.sequence;
    hello.protocol = WIRE_PROTOCOL;
    hello.dbc = WIRE_DBC;
    hello.profile = asked.profile;
    hello.check = 0;
    if (asked.protocol != WIRE_PROTOCOL)
        hello.status = WIRE_HELLO_STATUS_PROTOCOL_DIFFERS_CHOICE;
    else if (asked.dbc != WIRE_DBC)
        hello.status = WIRE_HELLO_STATUS_DBC_DIFFERS_CHOICE;
    else if (constants(asked.profile) == NULL)
        hello.status = WIRE_HELLO_STATUS_NO_SUCH_PROFILE_CHOICE;
    else if (asked.pace > WIRE_OPEN_PACE_REALTIME_CHOICE)
        hello.status = WIRE_HELLO_STATUS_NO_SUCH_PACE_CHOICE;
    else
        hello.status = WIRE_HELLO_STATUS_OK_CHOICE;
    name(reply, WIRE_HELLO_FRAME_ID);
    (void)wire_hello_pack(reply->data, &hello, MESSAGE_DATA_MAX);
    if (hello.status != WIRE_HELLO_STATUS_OK_CHOICE)
        return COMMANDS_ANSWERED;
    commands_start(commands);
    parameters_start(&commands->parameters, constants(asked.profile));
    commands->open = true;
    commands->realtime = asked.pace == WIRE_OPEN_PACE_REALTIME_CHOICE;
    return COMMANDS_OPENED;
}

/* Whether the diagram of mode.h has an arrow for it. */
static bool leads_on(mode_name_t mode, uint8_t command)
{
    if (command == MODE_START)
        return mode == MODE_IDLE;
    if (command == MODE_ABORT)
        return mode == MODE_RUN;
    return command == MODE_RESET && mode != MODE_RUN;
}

static void command_mode(commands_t *commands, const mode_state_t *mode, const message_t *message, message_t *reply)
{
    struct wire_mode_command_t asked;
    struct wire_mode_reply_t answer;

    (void)wire_mode_command_unpack(&asked, message->data, MESSAGE_DATA_MAX);
    answer.sequence = asked.sequence;
    answer.command = asked.command;
    answer.mode = (uint8_t)mode->mode;
    answer.fault = (uint8_t)mode->fault;
    answer.check = 0;
    if (asked.command < MODE_START || asked.command > MODE_RESET) {
        answer.status = PARAMETERS_UNKNOWN;
    } else if (!leads_on(mode->mode, asked.command)) {
        answer.status = PARAMETERS_RANGE;
    } else {
        answer.status = PARAMETERS_OK;
        commands->pending = (mode_command_t)asked.command;
    }
    name(reply, WIRE_MODE_REPLY_FRAME_ID);
    (void)wire_mode_reply_pack(reply->data, &answer, MESSAGE_DATA_MAX);
}

static void parameter(commands_t *commands, bool running, const message_t *message, message_t *reply)
{
    struct wire_parameter_request_t asked;
    struct wire_parameter_t answer;
    int32_t value = 0;

    (void)wire_parameter_request_unpack(&asked, message->data, MESSAGE_DATA_MAX);
    answer.sequence = asked.sequence;
    answer.parameter = asked.parameter;
    answer.check = 0;
    answer.status = PARAMETERS_OK;
    if (asked.write != 0)
        answer.status = (uint8_t)parameters_write(&commands->parameters, asked.parameter, asked.value, running);
    if (parameters_read(&commands->parameters, asked.parameter, &value) != PARAMETERS_OK)
        answer.status = PARAMETERS_UNKNOWN;
    answer.value = value;
    name(reply, WIRE_PARAMETER_FRAME_ID);
    (void)wire_parameter_pack(reply->data, &answer, MESSAGE_DATA_MAX);
}

static void waypoint(commands_t *commands, const message_t *message, message_t *reply)
{
    struct wire_waypoint_request_t asked;
    struct wire_waypoint_t answer;

    (void)wire_waypoint_request_unpack(&asked, message->data, MESSAGE_DATA_MAX);
    answer.sequence = asked.sequence;
    answer.index = asked.index;
    answer.check = 0;
    answer.x = asked.x;
    answer.y = asked.y;
    answer.status = PARAMETERS_OK;
    if (asked.write == 0) {
        if (asked.index < commands->route.count) {
            answer.x = commands->waypoints[asked.index].x_mm;
            answer.y = commands->waypoints[asked.index].y_mm;
        } else {
            answer.status = PARAMETERS_UNKNOWN;
        }
    } else if (asked.index >= ROUTE_WAYPOINTS_MAX) {
        answer.status = PARAMETERS_UNKNOWN;
    } else if (fix_abs_u16(asked.x) > ROUTE_COORDINATE_MAX_MM || fix_abs_u16(asked.y) > ROUTE_COORDINATE_MAX_MM) {
        answer.status = PARAMETERS_RANGE;
    } else {
        commands->next[asked.index].x_mm = asked.x;
        commands->next[asked.index].y_mm = asked.y;
        commands->written |= (uint32_t)1 << asked.index;
    }
    name(reply, WIRE_WAYPOINT_FRAME_ID);
    (void)wire_waypoint_pack(reply->data, &answer, MESSAGE_DATA_MAX);
}

static uint16_t check_of_route(const route_waypoint_t *waypoints, uint8_t count)
{
    uint16_t crc = CHECK_START;
    for (uint8_t i = 0; i < count; i++) {
        uint8_t bytes[4];
        bytes[0] = (uint8_t)waypoints[i].x_mm;
        bytes[1] = (uint8_t)((uint16_t)waypoints[i].x_mm >> 8);
        bytes[2] = (uint8_t)waypoints[i].y_mm;
        bytes[3] = (uint8_t)((uint16_t)waypoints[i].y_mm >> 8);
        crc = check_crc16(crc, bytes, 4);
    }
    return crc;
}

static uint8_t set_route(commands_t *commands, bool running, uint8_t count, uint16_t check)
{
    route_t tried;
    route_status_t status;

    if (count > 0 && count == commands->route.count && check == check_of_route(commands->waypoints, count))
        return ROUTE_OK; /* asked again: the answer was lost */
    if (running)
        return ROUTE_BUSY;
    if (count > ROUTE_WAYPOINTS_MAX)
        return ROUTE_TOO_LONG;
    for (uint8_t i = 0; i < count; i++)
        if ((commands->written & ((uint32_t)1 << i)) == 0)
            return ROUTE_INCOMPLETE;
    if (check_of_route(commands->next, count) != check)
        return ROUTE_DIFFERS;
    status = route_set(&tried, commands->next, count);
    if (status != ROUTE_OK)
        return (uint8_t)status;
    bytes_copy(commands->waypoints, commands->next, sizeof commands->waypoints);
    commands->written = 0;
    return (uint8_t)route_set(&commands->route, commands->waypoints, count);
}

static void route(commands_t *commands, bool running, const message_t *message, message_t *reply)
{
    struct wire_route_request_t asked;
    struct wire_route_t answer;

    (void)wire_route_request_unpack(&asked, message->data, MESSAGE_DATA_MAX);
    answer.sequence = asked.sequence;
    answer.check = 0;
    answer.status = asked.write == 0 ? (uint8_t)ROUTE_OK : set_route(commands, running, asked.count, asked.route_check);
    answer.count = commands->route.count;
    answer.route_check = check_of_route(commands->waypoints, commands->route.count);
    name(reply, WIRE_ROUTE_FRAME_ID);
    (void)wire_route_pack(reply->data, &answer, MESSAGE_DATA_MAX);
}

static commands_result_t obey(commands_t *commands, const mode_state_t *mode, const message_t *message,
                              message_t *reply)
{
    const bool running = mode->mode == MODE_RUN || commands->pending == MODE_START;

    if (message->id == WIRE_OPEN_FRAME_ID)
        return open_session(commands, message, reply);
    if (!commands->open)
        return COMMANDS_NOTHING;
    if (message->id == WIRE_MODE_COMMAND_FRAME_ID)
        command_mode(commands, mode, message, reply);
    else if (message->id == WIRE_PARAMETER_REQUEST_FRAME_ID)
        parameter(commands, running, message, reply);
    else if (message->id == WIRE_WAYPOINT_REQUEST_FRAME_ID)
        waypoint(commands, message, reply);
    else if (message->id == WIRE_ROUTE_REQUEST_FRAME_ID)
        route(commands, running, message, reply);
    else
        return COMMANDS_NOTHING;
    return COMMANDS_ANSWERED;
}

commands_result_t commands_take(commands_t *commands, const mode_state_t *mode, const message_t *message,
                                message_t *reply)
{
    commands_result_t result;

    if (!check_holds(message)) {
        commands->refused = fix_count_u16(commands->refused);
        return COMMANDS_NOTHING;
    }
    result = obey(commands, mode, message, reply);
    if (result != COMMANDS_NOTHING)
        check_seal(reply);
    return result;
}
