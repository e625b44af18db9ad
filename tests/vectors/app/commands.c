#include "app/commands.h"

#include "vectors.h"
#include "wire/crc.h"
#include "wire/codecs_gen.h"

enum { FEW = 4, WRITE = 0x40, NUMBER = 0x3F };

static void put(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

/* CRC of the first `count` waypoints written: what a host would send to have them flown. */
static uint16_t check_of_next(commands_t *commands, uint8_t count)
{
    const route_waypoint_t *const next = commands_written(commands);
    uint16_t crc = CRC_START;
    uint8_t bytes[4];

    for (uint8_t i = 0; i < count && i < ROUTE_WAYPOINTS_MAX; i++) {
        put(&bytes[0], (uint16_t)next[i].x_mm);
        put(&bytes[2], (uint16_t)next[i].y_mm);
        crc = crc_of_bytes(crc, bytes, 4);
    }
    return crc;
}

/* A request that mostly makes sense: bytes 0 to 5 as in brickpilot.dbc. */
static void draw(commands_t *commands, message_t *message)
{
    static const uint16_t ids[8] = {WIRE_PARAMETER_REQUEST_FRAME_ID, WIRE_WAYPOINT_REQUEST_FRAME_ID,
                                    WIRE_ROUTE_REQUEST_FRAME_ID,     WIRE_MODE_COMMAND_FRAME_ID,
                                    WIRE_WAYPOINT_REQUEST_FRAME_ID,  WIRE_PARAMETER_REQUEST_FRAME_ID,
                                    WIRE_WAYPOINT_REQUEST_FRAME_ID,  WIRE_IMU_FRAME_ID};
    uint8_t *const data = message->data;

    message->id = draw_rarely(6) ? WIRE_OPEN_FRAME_ID : ids[draw_u16() & 7U];
    message->size = draw_rarely(8) ? 7 : MESSAGE_DATA_MAX;
    data[0] = (uint8_t)draw_u16();
    data[1] = (uint8_t)draw_u16(); /* a number or count, and whether to write */
    if (!draw_rarely(2))
        data[1] = (uint8_t)((data[1] & WRITE) | draw_up_to(FEW));
    put(&data[2], draw_rarely(1) ? draw_u16() : (uint16_t)draw_s16());
    put(&data[4], draw_rarely(1) ? draw_u16() : (uint16_t)draw_s16());
    if (message->id == WIRE_OPEN_FRAME_ID) {
        data[1] = (uint8_t)(WIRE_PROTOCOL + (draw_rarely(3) ? 1U : 0U));
        put(&data[2], (uint16_t)(WIRE_DBC + (draw_rarely(3) ? 1U : 0U)));
        data[4] = (uint8_t)draw_up_to(2);
        data[5] = (uint8_t)draw_up_to(2);
    } else if (message->id == WIRE_MODE_COMMAND_FRAME_ID) {
        data[1] = (uint8_t)draw_up_to(MODE_CUT_LATE);
    } else if (message->id == WIRE_ROUTE_REQUEST_FRAME_ID && !draw_rarely(2)) {
        put(&data[2], check_of_next(commands, data[1] & NUMBER));
    }
    crc_seal(message);
    if (draw_rarely(4))
        data[draw_u16() & 7U] ^= 1U;
}

void vectors_feed(void)
{
    static commands_t commands;
    static bool started;
    loop_state_t loop;
    message_t message;

    if (!started || draw_rarely(12))
        commands_start(&commands);
    started = true;
    loop.step.mode.mode = (mode_name_t)draw_up_to(MODE_FAULT);
    loop.step.mode.fault = (mode_fault_t)draw_up_to(MODE_LATE);
    draw(&commands, &message);
    loop.tick = 1;
    const bool result = commands_take(&commands, &loop, &message);
    hash_u8(result);
    hash_u8((uint8_t)loop.tick);
    if (result) {
        hash_u16(message.id);
        hash_u8(message.size);
        for (uint8_t i = 0; i < MESSAGE_DATA_MAX; i++)
            hash_u8(message.data[i]);
    }
    hash_u8(commands.route.count);
    for (uint8_t i = 0; i < FEW + 1; i++)
        hash_s16(commands_written(&commands)[i].x_mm);
    hash_u8(commands.open);
    hash_u8(commands.realtime);
    if (draw_rarely(1))
        hash_u8((uint8_t)commands_next(&commands));
}
