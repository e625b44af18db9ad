/* template.c: a port that does nothing yet. README.md says how to turn it into a port.
 *
 * hal.h states the unit and the range of every value. No call may block.
 */
#include "hal.h"
#include "template/not_done.h"

uint32_t hal_clock_ms(void)
{
    NOT_DONE("return the milliseconds since power-on");
    return 0;
}

hal_status_t hal_imu_read(hal_imu_t *out)
{
    (void)out;
    NOT_DONE("write the newest accelerations and yaw rate and return HAL_OK, or HAL_PARTLY for a gyro alone");
    return HAL_ABSENT;
}

hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    (void)out;
    NOT_DONE("write the counts of both rotation sensors and return HAL_OK");
    return HAL_ABSENT;
}

hal_status_t hal_reference_read(hal_reference_t *out)
{
    (void)out;
    NOT_DONE("return HAL_ABSENT, unless something outside the robot measures its position");
    return HAL_ABSENT;
}

hal_status_t hal_battery_read(uint16_t *out_mv)
{
    (void)out_mv;
    NOT_DONE("write the battery's voltage and return HAL_OK");
    return HAL_ABSENT;
}

void hal_motors_write(int16_t left_q15, int16_t right_q15)
{
    (void)left_q15;
    (void)right_q15;
    NOT_DONE("set the duty of both motors");
}

bool hal_link_write(const message_t *message)
{
    (void)message;
    NOT_DONE("put the message into the transmit queue and return true, or false if the queue is full");
    return false;
}

bool hal_link_read(message_t *message)
{
    (void)message;
    NOT_DONE("take the oldest message from the receive queue and return true, or false if there is none");
    return false;
}
