/* port.h: what the contract suite needs of a port under test: a hand on the world around it.
 *
 * A port gets a file port_NAME.c that defines these, and a line in tests/CMakeLists.txt. On a brick or its simulator the
 * world is whatever stands in for sensors, motors and the other end of the link.
 */
#ifndef BRICKPILOT_CONTRACT_PORT_H
#define BRICKPILOT_CONTRACT_PORT_H

#include <stdbool.h>

#include "hal.h"

/* Devices that a port may have; others are HAL_ABSENT for ever. PORT_GYRO is an IMU without accelerometer, HAL_PARTLY. */
enum { PORT_IMU = 1, PORT_ROTATION = 2, PORT_BATTERY = 4, PORT_REFERENCE = 8, PORT_GYRO = 16 };

typedef struct {
    hal_imu_t imu;
    hal_rotation_t rotation;
    uint16_t battery_mv;
    hal_reference_t reference;
} port_world_t;

/* Switched on afresh, nothing measured yet; and off. */
void port_begin(void);
void port_end(void);

/* PORT_ bits that it can have. */
unsigned port_devices(void);

/* Those of them whose HAL_STALE or HAL_ABSENT the port can tell. Where it cannot, port_why_not() says why; else it is NULL. */
unsigned port_tells(hal_status_t status);
const char *port_why_not(hal_status_t status);

/* What becomes of the world's values, and of a duty, in converters and drivers of few bits; as they are where there are none. */
port_world_t port_resolved(const port_world_t *world);
int16_t port_resolved_duty(int16_t duty_q15);

/* `ms` pass, then a step begins: the devices in `working` have new readings of `world`, those in `silent` have none, and the
 * others are not there. */
void port_step(uint32_t ms, unsigned working, unsigned silent, const port_world_t *world);

/* What the motors have now. */
void port_motors(int16_t *left_q15, int16_t *right_q15);

/* Messages of a host that wait for the controller; more, before it reads them, are lost. */
uint8_t port_room(void);

/* The other end of the link. False: no room, none there. */
bool port_host_send(const message_t *message);
bool port_host_receive(message_t *message);

#endif
