/* port.h: what the contract suite needs to know of a port, and the world around it that the suite controls.
 *
 * hal/template/README.md says how to add a port: a file port_NAME.c defines the functions below. On a brick or its
 * simulator the world replaces the sensors, the motors and the other end of the link.
 */
#ifndef BRICKPILOT_CONTRACT_PORT_H
#define BRICKPILOT_CONTRACT_PORT_H

#include <stdbool.h>

#include "hal.h"

/* Devices that a port may have. PORT_GYRO is an IMU without an accelerometer: HAL_PARTLY. */
enum { PORT_IMU = 1, PORT_ROTATION = 2, PORT_BATTERY = 4, PORT_REFERENCE = 8, PORT_GYRO = 16 };

typedef struct {
    hal_imu_t imu;
    hal_rotation_t rotation;
    uint16_t battery_mv;
    hal_reference_t reference;
} port_world_t;

/* Switch the port on, with nothing measured yet, and off. */
void port_begin(void);
void port_end(void);

/* Returns the devices that the port can have, as PORT_ bits. The others are HAL_ABSENT for ever. */
unsigned port_devices(void);

/* Returns the devices for which the port can return HAL_STALE, or HAL_ABSENT. port_why_not() says why it cannot for the
 * other devices, or returns NULL if there are none. */
unsigned port_tells(hal_status_t status);
const char *port_why_not(hal_status_t status);

/* Rounds the world's values, and a duty, as the port's converters and drivers do. */
port_world_t port_resolved(const port_world_t *world);
int16_t port_resolved_duty(int16_t duty_q15);

/* Lets `ms` pass; then a step begins. The devices in `working` have new readings of `world`, those in `silent` have none, and
 * the others are not there. */
void port_step(uint32_t ms, unsigned working, unsigned silent, const port_world_t *world);

/* Gives the duty that the motors have now. */
void port_motors(int16_t *left_q15, int16_t *right_q15);

/* Returns how many messages of the host can wait for the controller. */
uint8_t port_room(void);

/* Send and receive at the other end of the link. Return false if there is no room, or no message. */
bool port_host_send(const message_t *message);
bool port_host_receive(message_t *message);

#endif
