#include "app/commands.h"

#include <stddef.h>

#include "app/params_gen.h"
#include "core/bytes.h"
#include "core/fix.h"
#include "wire/crc.h"
#include "wire/codecs_gen.h"

/* Statuses of the reply ROUTE that route_status_t does not have. */
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

/* Returns the constants of a profile, or NULL if this image does not hold that profile. */
static const FLASH loop_config_t *constants_of(uint8_t profile)
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

static void start(commands_t *commands, const FLASH loop_config_t *constants)
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

/* Carries out one kind of request, writes the fields of the reply into `data`, and returns the reply's status. */
typedef uint8_t request_t(commands_t *commands, loop_state_t *loop, uint8_t *data);

static uint8_t open_session(commands_t *commands, loop_state_t *loop, uint8_t *data)
{
    const uint8_t pace = data[WIRE_OPEN_PACE_AT];
    const FLASH loop_config_t *constants;
    uint8_t status;

    if (data[WIRE_OPEN_PROTOCOL_AT] != WIRE_PROTOCOL) {
        status = WIRE_HELLO_STATUS_PROTOCOL_DIFFERS_CHOICE;
    } else if (message_get(&data[WIRE_OPEN_DBC_AT]) != WIRE_DBC) {
        status = WIRE_HELLO_STATUS_DBC_DIFFERS_CHOICE;
    } else if ((constants = constants_of(data[WIRE_OPEN_PROFILE_AT])) == NULL) {
        status = WIRE_HELLO_STATUS_NO_SUCH_PROFILE_CHOICE;
    } else if (pace > WIRE_OPEN_PACE_REALTIME_CHOICE) {
        status = WIRE_HELLO_STATUS_NO_SUCH_PACE_CHOICE;
    } else {
        start(commands, constants);
        commands->open = true;
        commands->realtime = pace;
        bytes_clear(loop, sizeof *loop);
        status = WIRE_HELLO_STATUS_OK_CHOICE;
    }
    data[WIRE_HELLO_PROTOCOL_AT] = WIRE_PROTOCOL;
    message_put(&data[WIRE_HELLO_DBC_AT], WIRE_DBC);
    return status;
}

/* True if the diagram of mode.h has an arrow for this command out of this mode. */
static bool leads_on(mode_name_t mode, uint8_t command)
{
    if (command == MODE_START)
        return mode == MODE_IDLE;
    return (mode == MODE_RUN) == (command == MODE_ABORT);
}

static uint8_t command_mode(commands_t *commands, loop_state_t *loop, uint8_t *data)
{
    const mode_state_t *const mode = &loop->step.mode;
    const uint8_t command = data[WIRE_MODE_COMMAND_COMMAND_AT];

    data[WIRE_MODE_REPLY_MODE_AT] = (uint8_t)(mode->mode | mode->fault << WIRE_MODE_REPLY_FAULT_SHIFT);
    data[WIRE_MODE_REPLY_STATUS_AT + 1] = data[WIRE_MODE_REPLY_STATUS_AT + 2] = 0;
    if (command < MODE_START || command > MODE_RESET)
        return PARAMETERS_UNKNOWN;
    if (!leads_on(mode->mode, command))
        return PARAMETERS_RANGE;
    commands->pending = (mode_command_t)command;
    return PARAMETERS_OK;
}

static bool running(const commands_t *commands, const loop_state_t *loop)
{
    return loop->step.mode.mode == MODE_RUN || commands->pending == MODE_START;
}

/* The requests for parameters, waypoints and routes share two fields: a number, and a flag that asks to write. */
static inline uint8_t number_of(const uint8_t *data)
{
    return data[WIRE_PARAMETER_REQUEST_PARAMETER_AT] & WIRE_PARAMETER_REQUEST_PARAMETER_MASK;
}

static inline bool writes(const uint8_t *data)
{
    return (data[WIRE_PARAMETER_REQUEST_WRITE_AT] & 1U << WIRE_PARAMETER_REQUEST_WRITE_SHIFT) != 0;
}

static uint8_t parameter(commands_t *commands, loop_state_t *loop, uint8_t *data)
{
    return (uint8_t)parameters_take(&commands->parameters, running(commands, loop), data);
}

/* Copies a waypoint out of WAYPOINT_REQUEST or into WAYPOINT. */
static void move_waypoint(void *to, const void *from)
{
    message_move(to, from, sizeof(int16_t));
    message_move((uint8_t *)to + sizeof(int16_t), (const uint8_t *)from + sizeof(int16_t), sizeof(int16_t));
}

static bool too_far(const uint8_t *at)
{
    return fix_abs_u16((int16_t)message_get(at)) > ROUTE_COORDINATE_MAX_MM;
}

static uint8_t waypoint(commands_t *commands, loop_state_t *loop, uint8_t *data)
{
    uint8_t *const at = &data[WIRE_WAYPOINT_X_AT];
    const uint8_t index = number_of(data);

    (void)loop;
    if (!writes(data)) {
        if (index >= commands->route.count)
            return PARAMETERS_UNKNOWN;
        move_waypoint(at, &commands->route.waypoints[index]);
    } else {
        if (index >= ROUTE_WAYPOINTS_MAX)
            return PARAMETERS_UNKNOWN;
        if (too_far(at) || too_far(at + sizeof(int16_t)))
            return PARAMETERS_RANGE;
        move_waypoint(&commands_written(commands)[index], at);
    }
    return PARAMETERS_OK;
}

static uint16_t crc_of_route(const route_waypoint_t *waypoint, uint8_t count)
{
    uint16_t crc = CRC_START;

    for (; count > 0; count--) {
        crc = crc_of_number(crc_of_number(crc, (uint16_t)waypoint->x_mm), (uint16_t)waypoint->y_mm);
        waypoint++;
    }
    return crc;
}

static uint16_t crc_in_force(const commands_t *commands)
{
    return crc_of_route(commands->route.waypoints, commands->route.count);
}

static bool is_written(const route_waypoint_t *waypoint, uint8_t count)
{
    for (; count > 0; count--)
        if ((waypoint++)->x_mm == COMMANDS_UNWRITTEN)
            return false;
    return true;
}

static uint8_t route(commands_t *commands, loop_state_t *loop, uint8_t *data)
{
    const uint16_t crc = message_get(&data[WIRE_ROUTE_REQUEST_ROUTE_CHECK_AT]);
    const route_waypoint_t *const written = commands_written(commands);
    const uint8_t count = number_of(data);
    uint8_t status = ROUTE_OK;

    if (!writes(data) || (count > 0 && count == commands->route.count && crc == crc_in_force(commands))) {
        /* the host only reads, or repeats a request whose reply was lost */
    } else if (running(commands, loop)) {
        status = ROUTE_BUSY;
    } else if (count > ROUTE_WAYPOINTS_MAX) {
        status = ROUTE_TOO_LONG;
    } else if (!is_written(written, count)) {
        status = ROUTE_INCOMPLETE;
    } else if (crc_of_route(written, count) != crc) {
        status = ROUTE_DIFFERS;
    } else {
        status = (uint8_t)route_set(&commands->route, written, count);
        if (status == ROUTE_OK)
            forget_written(commands);
    }
    data[WIRE_ROUTE_COUNT_AT] = commands->route.count;
    message_put(&data[WIRE_ROUTE_ROUTE_CHECK_AT], crc_in_force(commands));
    data[WIRE_ROUTE_STATUS_AT + 1] = 0;
    return status;
}

static const struct row {
    uint16_t id; /* id of the request; the reply has the next id */
    request_t *take;
    uint8_t status_at;  /* index of the status byte in the reply's data */
    bool beside_number; /* the status is in the upper bits of the byte that holds the number */
} REQUESTS[] = {
    {WIRE_OPEN_FRAME_ID, open_session, WIRE_HELLO_STATUS_AT, false},
    {WIRE_MODE_COMMAND_FRAME_ID, command_mode, WIRE_MODE_REPLY_STATUS_AT, false},
    {WIRE_PARAMETER_REQUEST_FRAME_ID, parameter, WIRE_PARAMETER_STATUS_AT, true},
    {WIRE_WAYPOINT_REQUEST_FRAME_ID, waypoint, WIRE_WAYPOINT_STATUS_AT, true},
    {WIRE_ROUTE_REQUEST_FRAME_ID, route, WIRE_ROUTE_STATUS_AT, false},
};
enum { REQUESTS_COUNT = sizeof REQUESTS / sizeof REQUESTS[0] };

bool commands_take(commands_t *commands, loop_state_t *loop, message_t *message)
{
    uint8_t *const data = message->data;
    const struct row *row = REQUESTS;
    uint8_t status;

    while (row->id != message->id)
        if (++row == REQUESTS + REQUESTS_COUNT)
            return false;
    if (!crc_holds(message) || !(commands->open || row == REQUESTS))
        return false;
    message->id++;
    status = row->take(commands, loop, data);
    if (row->beside_number)
        status = (uint8_t)(number_of(data) | (uint8_t)(status << WIRE_PARAMETER_STATUS_SHIFT));
    data[row->status_at] = status;
    crc_seal(message);
    return true;
}
