#include <dmotor.h>
#include <time.h>

#include "hal.h"

/* Every 2 ms, and when a waiting task goes on, brickOS adds the speed to an 8-bit sum, and gives a pulse when the sum
 * overflows. So a speed of 0..254 gives speed / 256 of full power, and 255 gives full power. A duty of 0 shorts the
 * motor, as in the controller's model. Between pulses brickOS lets the motor float. */
static uint8_t speed_of(int16_t duty_q15, MotorDirection *direction)
{
    const uint16_t size = duty_q15 < 0 ? -(uint16_t)duty_q15 : (uint16_t)duty_q15;
    const uint16_t speed = (uint16_t)(size + 64U) >> 7;

    *direction = speed == 0 ? brake : duty_q15 > 0 ? fwd : rev;
    return speed == 0 || speed > MAX_SPEED ? MAX_SPEED : (uint8_t)speed;
}

void hal_motors_write(int16_t left_q15, int16_t right_q15)
{
    MotorDirection direction;
    uint8_t speed = speed_of(left_q15, &direction);

    motor_a_dir(direction);
    motor_a_speed(speed);
    speed = speed_of(right_q15, &direction);
    motor_c_dir(direction);
    motor_c_speed(speed);
}

uint32_t hal_clock_ms(void)
{
    return get_system_up_time();
}
