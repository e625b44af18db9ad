/* fuzz_brick.c: any messages to a brick, sealed or not, and any time between them. Motors turn in RUN alone, settings stay
 * within their ranges, and the route in force is one that can be flown.
 *
 * Input: records of an action, a message's id and data. The action's bits: 1 seal the message, 2 a set's SYNC is given the
 * CRC of the parts before it, 4 time passes, 8 the id is taken for an index of those that a host sends.
 */
#include <stdlib.h>
#include <string.h>

#include "app/settings_gen.h"
#include "brick/brick.h"
#include "wire/crc.h"

enum { RECORD = 11, PARTS_MOST = 6 };

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static const uint16_t OF_HOST[] = {WIRE_OPEN_FRAME_ID,
                                   WIRE_MODE_COMMAND_FRAME_ID,
                                   WIRE_IMU_FRAME_ID,
                                   WIRE_ROTATION_FRAME_ID,
                                   WIRE_BATTERY_FRAME_ID,
                                   WIRE_REFERENCE_X_FRAME_ID,
                                   WIRE_REFERENCE_Y_FRAME_ID,
                                   WIRE_REFERENCE_TURN_FRAME_ID,
                                   WIRE_SYNC_FRAME_ID,
                                   WIRE_PARAMETER_REQUEST_FRAME_ID,
                                   WIRE_WAYPOINT_REQUEST_FRAME_ID,
                                   WIRE_ROUTE_REQUEST_FRAME_ID};

static void require(bool holds)
{
    if (!holds)
        abort();
}

static void take_answers(brick_t *brick)
{
    message_t message;
    while (brick_give(brick, &message))
        if (message.id == WIRE_MOTORS_FRAME_ID) {
            struct wire_motors_t motors;
            require(crc_holds(&message));
            wire_motors_unpack(&motors, message.data, 8);
            require((motors.left == 0 && motors.right == 0) || brick->loop.step.mode.mode == MODE_RUN);
            require(motors.left >= -32767 && motors.right >= -32767);
        }
}

static void check(const brick_t *brick)
{
    route_t tried;
    for (uint8_t i = 0; i < SETTINGS_COUNT; i++) {
        parameters_t copy = brick->commands.parameters;
        uint8_t data[8] = {0, i};
        require(parameters_take(&copy, false, data) == PARAMETERS_OK);
        data[1] |= 1U << WIRE_PARAMETER_REQUEST_WRITE_SHIFT;
        require(parameters_take(&copy, false, data) == PARAMETERS_OK);
    }
    require(brick->commands.route.count == 0 ||
            route_set(&tried, brick->commands.route.waypoints, brick->commands.route.count) == ROUTE_OK);
}

/* A host that knows this DBC: otherwise no session would ever open. */
static void make_open(message_t *message)
{
    struct wire_open_t open;
    wire_open_unpack(&open, message->data, 8);
    open.protocol = WIRE_PROTOCOL;
    open.dbc = WIRE_DBC;
    open.profile &= 1;
    open.pace &= 1;
    wire_open_pack(message->data, &open, 8);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    static brick_t brick;
    int64_t now_us = 0;
    message_t parts[PARTS_MOST];
    uint8_t count = 0;

    brick_start(&brick);
    for (; size >= RECORD; bytes += RECORD, size -= RECORD) {
        message_t message = {.id = (uint16_t)((bytes[1] | bytes[2] << 8) & MESSAGE_ID_MAX),
                             .size = (bytes[0] & 0xF0) == 0xF0 ? bytes[2] % 9 : 8};
        if (bytes[0] & 8)
            message.id = OF_HOST[bytes[1] % (sizeof OF_HOST / sizeof *OF_HOST)];
        memcpy(message.data, bytes + 3, 8);
        if (message.id == WIRE_OPEN_FRAME_ID && bytes[0] & 1)
            make_open(&message);
        if (message.id == WIRE_SYNC_FRAME_ID && bytes[0] & 2) {
            uint16_t crc = crc_of_message(&message);
            for (uint8_t i = 0; i < count; i++)
                crc = crc_of_bytes(crc, parts[i].data, 8);
            message.data[6] = (uint8_t)crc;
            message.data[7] = (uint8_t)(crc >> 8);
        } else if (bytes[0] & 1 && (message.id < WIRE_IMU_FRAME_ID || message.id > WIRE_SYNC_FRAME_ID)) {
            crc_seal(&message);
        }
        if (message.id >= WIRE_IMU_FRAME_ID && message.id < WIRE_SYNC_FRAME_ID)
            parts[count++ % PARTS_MOST] = message;
        if (message.id == WIRE_SYNC_FRAME_ID || count == PARTS_MOST)
            count = 0;
        brick_take(&brick, &message);
        take_answers(&brick);
        if (bytes[0] & 4) {
            now_us += (int64_t)bytes[1] * 1000;
            brick_time(&brick, now_us);
            take_answers(&brick);
        }
    }
    check(&brick);
    return 0;
}
