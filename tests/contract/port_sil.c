/* port_sil.c: the port in process. */
#include <stddef.h>

#include "port.h"
#include "sil/sil.h"

static sil_port_t port;

void port_begin(void)
{
    port = (sil_port_t){0};
    sil_bind(&port);
}
void port_end(void)
{
    sil_bind(NULL);
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
    port.clock_ms += ms;
    port.imu_status = status(PORT_IMU, working, silent);
    port.rotation_status = status(PORT_ROTATION, working, silent);
    port.battery_status = status(PORT_BATTERY, working, silent);
    port.reference_status = status(PORT_REFERENCE, working, silent);
    port.imu = world->imu;
    port.rotation = world->rotation;
    port.battery_mv = world->battery_mv;
    port.reference = world->reference;
}

void port_motors(int16_t *left_q15, int16_t *right_q15)
{
    *left_q15 = port.left_q15;
    *right_q15 = port.right_q15;
}

uint8_t port_room(void)
{
    return 8;
}

bool port_host_send(const message_t *message)
{
    if (port.link_in_size == SIL_LINK_SIZE)
        return false;
    port.link_in[port.link_in_size++] = *message;
    return true;
}

bool port_host_receive(message_t *message)
{
    if (port.link_out_size == 0)
        return false;
    *message = port.link_out[0];
    port.link_out_size--;
    for (uint16_t i = 0; i < port.link_out_size; i++)
        port.link_out[i] = port.link_out[i + 1];
    return true;
}
