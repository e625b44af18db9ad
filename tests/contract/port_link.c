/* port_link.c: the port over messages, with its world at the other end of two COBS lines. */
#include <stddef.h>

#include "../unit/link/sets.h"
#include "link/link.h"
#include "port.h"
#include "wire/frame.h"

static link_port_t port;
static sets_reading_t shown;
static int16_t left, right; /* as the last valid MOTORS said */

/* Returns the message as the transport delivers it. */
static message_t carried(const message_t *message)
{
    uint8_t bytes[FRAME_SIZE_MAX];
    frame_decoder_t decoder = {.size = 0};
    message_t got = {.id = 0};
    const uint8_t count = frame_encode(message, bytes);
    for (uint8_t i = 0; i < count; i++)
        (void)frame_take(&decoder, bytes[i], &got);
    return got;
}

static bool send(const message_t *message)
{
    const message_t got = carried(message);
    const uint8_t before = port.in_size;
    return link_take(&port, &got) != LINK_MESSAGE || port.in_size > before;
}

void port_begin(void)
{
    port = (link_port_t){.clock_ms = 0};
    shown = (sets_reading_t){.time_ms = 0};
    left = right = 0;
    link_bind(&port);
}
void port_end(void)
{
    link_bind(NULL);
}

unsigned port_devices(void)
{
    return PORT_IMU | PORT_ROTATION | PORT_BATTERY | PORT_REFERENCE;
}

unsigned port_tells(hal_status_t status)
{
    (void)status;
    return port_devices();
}

const char *port_why_not(hal_status_t status)
{
    (void)status;
    return NULL;
}

port_world_t port_resolved(const port_world_t *world)
{
    return *world;
}

int16_t port_resolved_duty(int16_t duty_q15)
{
    return duty_q15;
}

static hal_status_t status(unsigned device, unsigned working, unsigned silent)
{
    return (working & device) != 0 ? HAL_OK : (silent & device) != 0 ? HAL_STALE : HAL_ABSENT;
}

void port_step(uint32_t ms, unsigned working, unsigned silent, const port_world_t *world)
{
    message_t messages[SETS_MOST];

    link_stepped(&port);
    shown.time_ms += ms;
    shown.sequence++;
    if (working == 0 && silent != 0) { /* the other end says nothing at all */
        port.clock_ms += ms;
        return;
    }
    shown.imu_status = status(PORT_IMU, working, silent);
    shown.rotation_status = status(PORT_ROTATION, working, silent);
    shown.battery_status = status(PORT_BATTERY, working, silent);
    shown.reference_status = status(PORT_REFERENCE, working, silent);
    shown.imu = world->imu;
    shown.rotation = world->rotation;
    shown.battery_mv = world->battery_mv;
    shown.reference = world->reference;
    const int count = sets_pack(&shown, messages);
    for (int i = 0; i < count; i++)
        (void)send(&messages[i]);
}

/* Receives the next message that is not for the motors. */
bool port_host_receive(message_t *message)
{
    while (link_give(&port, message)) {
        struct wire_motors_t motors;
        *message = carried(message);
        if (message->id != WIRE_MOTORS_FRAME_ID)
            return true;
        if (crc_holds(message) && wire_motors_unpack(&motors, message->data, 8) == 0) {
            left = motors.left;
            right = motors.right;
        }
    }
    return false;
}

void port_motors(int16_t *left_q15, int16_t *right_q15)
{
    message_t ignored;
    while (port_host_receive(&ignored)) {
    }
    *left_q15 = left;
    *right_q15 = right;
}

uint8_t port_room(void)
{
    return 8;
}

bool port_host_send(const message_t *message)
{
    return send(message);
}
