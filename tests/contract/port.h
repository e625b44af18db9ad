/* port.h: what the contract suite needs of a port under test: a hand on the world around it.
 *
 * A port gets a file port_NAME.c that defines these, and a line in tests/CMakeLists.txt. On a brick or its simulator the
 * world is whatever stands in for sensors, motors and the other end of the link.
 */
#ifndef BRICKPILOT_CONTRACT_PORT_H
#define BRICKPILOT_CONTRACT_PORT_H

#include <stdbool.h>

#include "hal.h"

/* Devices that a port may have; others are HAL_ABSENT for ever. */
enum { PORT_IMU = 1, PORT_ROTATION = 2, PORT_BATTERY = 4, PORT_REFERENCE = 8 };

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

/* `ms` pass, then a step begins: the devices in `working` have new readings of `world`, those in `silent` have none, and the
 * others are not there. */
void port_step(uint32_t ms, unsigned working, unsigned silent, const port_world_t *world);

/* What the motors have now. */
void port_motors(int16_t *left_q15, int16_t *right_q15);

/* The other end of the link. False: no room, none there. */
bool port_host_send(const message_t *message);
bool port_host_receive(message_t *message);

#endif
