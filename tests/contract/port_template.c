/* port_template.c: the world around a port that does nothing yet. hal/template/README.md says what to do with it. */
#include "port.h"

#include <stddef.h>
#include <stdio.h>

#include "template/not_done.h"
#include "unity.h"

/* Marks begin: a finished port needs none of this, and the recipe for a port removes it. */
static bool listing, listed;

void not_done(const char *function, const char *what)
{
    static char line[200];

    (void)snprintf(line, sizeof line, "%s: not done yet: %s", function, what);
    if (!listing)
        TEST_FAIL_MESSAGE(line);
    puts(line);
}

/* Prints a line for each function that is not done yet, once. */
static void list_what_is_not_done(void)
{
    hal_imu_t imu;
    hal_rotation_t rotation;
    hal_reference_t reference;
    uint16_t battery_mv;
    message_t message = {.size = 0};

    if (listed)
        return;
    listed = listing = true;
    (void)hal_clock_ms();
    (void)hal_imu_read(&imu);
    (void)hal_rotation_read(&rotation);
    (void)hal_reference_read(&reference);
    (void)hal_battery_read(&battery_mv);
    hal_motors_write(0, 0);
    (void)hal_link_write(&message);
    (void)hal_link_read(&message);
    listing = false;
}
/* Marks end. */

/* Put all devices and queues into the state after power-on. */
void port_begin(void)
{
    list_what_is_not_done();
}

/* Release what port_begin() took. */
void port_end(void) {}

/* Leave out the devices that your board never has. */
unsigned port_devices(void)
{
    return PORT_IMU | PORT_ROTATION | PORT_BATTERY;
}

/* Leave out the devices that your board cannot tell from a working one, and say why below. */
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

/* Round as your converters do. */
port_world_t port_resolved(const port_world_t *world)
{
    return *world;
}

/* Round as your motor drive does. */
int16_t port_resolved_duty(int16_t duty_q15)
{
    return duty_q15;
}

/* Let time pass, then put the values of `world` where your drivers read them. */
void port_step(uint32_t ms, unsigned working, unsigned silent, const port_world_t *world)
{
    (void)ms;
    (void)working;
    (void)silent;
    (void)world;
}

/* Say what your motor drive puts out. */
void port_motors(int16_t *left_q15, int16_t *right_q15)
{
    *left_q15 = *right_q15 = 0;
}

uint8_t port_room(void)
{
    return 8;
}

/* Play the host at the other end of your link. */
bool port_host_send(const message_t *message)
{
    (void)message;
    return false;
}

bool port_host_receive(message_t *message)
{
    (void)message;
    return false;
}
