/* board.h: the wiring of the robot, and the sign, zero and scale of each sensor. Edit it if your robot is wired differently.
 *
 * This file names no register, so that a simulator of the board can include it, too. A pin is a pair: the letter of its port, and
 * its bit. The chip is the compiler's target; a host says -DBOARD_ATMEGA2560, or gets the ATmega328P.
 */
#ifndef BRICKPILOT_AVR_BOARD_H
#define BRICKPILOT_AVR_BOARD_H

#if defined(__AVR_ATmega2560__) && !defined(BOARD_ATMEGA2560)
#define BOARD_ATMEGA2560
#endif

#define BOARD_CPU_HZ 16000000UL

/* Motors: an H-bridge like the TB6612FNG, with two inputs for the direction and one for the PWM of each motor.
 *
 *   IN1 IN2   PWM
 *    1   0   duty   forward: between the pulses the bridge shorts the motor
 *    0   1   duty   backward
 *    1   1    1     brake: the motor is shorted. Duty 0 does this, as the controller's model assumes
 *    0   0    0     coast: no current. After a reset, and in every safe state
 *
 * Timer 1 makes the PWM: fast, 10 bits, no prescaler, 15.6 kHz. OCR1A or OCR1B = 0..1023 gives a duty of 1..1024 parts
 * of 1024. While a motor coasts or brakes, its PWM pin is steady, off the timer. After a reset all pins are inputs:
 * pull-down resistors of 10 kilohm hold each of the six low. If a motor turns the wrong way, swap its two wires. */
#ifdef BOARD_ATMEGA2560
#define BOARD_LEFT_PWM B, 5  /* OC1A, pin 11 of an Arduino Mega */
#define BOARD_RIGHT_PWM B, 6 /* OC1B, pin 12 */
#define BOARD_LEFT_IN1 H, 3  /* pin 6 */
#define BOARD_LEFT_IN2 H, 4  /* pin 7 */
#define BOARD_RIGHT_IN1 H, 5 /* pin 8 */
#define BOARD_RIGHT_IN2 H, 6 /* pin 9 */
#else
#define BOARD_LEFT_PWM B, 1  /* OC1A, pin D9 of an Arduino Uno or Nano */
#define BOARD_RIGHT_PWM B, 2 /* OC1B, D10 */
#define BOARD_LEFT_IN1 D, 6
#define BOARD_LEFT_IN2 D, 7
#define BOARD_RIGHT_IN1 B, 0 /* D8 */
#define BOARD_RIGHT_IN2 B, 3 /* D11 */
#endif

/* Rotation sensors: quadrature, every edge counts, 48 edges a turn of the wheel. Forward: A leads B. The four pins stand side by side
 * in one port and make the pin-change interrupt 2; the internal pull-ups are on, for sensors with open collectors. */
#ifdef BOARD_ATMEGA2560
#define BOARD_LEFT_A K, 0 /* A8 */
#define BOARD_LEFT_B K, 1
#define BOARD_RIGHT_A K, 2
#define BOARD_RIGHT_B K, 3 /* A11 */
#else
#define BOARD_LEFT_A D, 2 /* D2 */
#define BOARD_LEFT_B D, 3
#define BOARD_RIGHT_A D, 4
#define BOARD_RIGHT_B D, 5 /* D5 */
#endif
#define BOARD_LEFT_REVERSED 0
#define BOARD_RIGHT_REVERSED 0

/* The IMU: analogue sensors, or a chip on the I2C bus: an MPU-6050 (MPU-6500, 9250, 9255) or an LSM6DS (DS3, DSL, DS3TR-C, DSO). The chip lies
 * with its x axis forward and its face up, near the robot's middle. Its ranges are 1,000 degrees/s and 2 g. Its module needs pull-up
 * resistors on both lines, as all boards with these chips have. SECOND_ADDRESS: 1 where its address pin (AD0, SA0) is high. */
#define BOARD_ANALOGUE 0
#define BOARD_MPU6050 1
#define BOARD_LSM6DS 2
#ifndef BOARD_IMU
#define BOARD_IMU BOARD_ANALOGUE
#endif
#define BOARD_IMU_SECOND_ADDRESS 0
#ifdef BOARD_ATMEGA2560
#define BOARD_SDA D, 1 /* pin 20 */
#define BOARD_SCL D, 0 /* pin 21 */
#else
#define BOARD_SDA C, 4 /* A4 */
#define BOARD_SCL C, 5 /* A5 */
#endif

/* Analogue inputs: channels 0 to 3 of the converter (PC0..PC3, or PF0..PF3 of the ATmega2560; A0..A3), against AVcc of 5 V. The gyro and
 * the accelerometers, if they are analogue, give 2.5 V for zero. Turning clockwise (from above) and accelerating
 * forward or to the right give more volts. ZERO is the reading at rest on level ground, in 1024ths of 5 V. PER_COUNT_Q8
 * is mrad/s or mm/s^2 per 1024th, times 256. */
#define BOARD_GYRO_INPUT 0
#define BOARD_SURGE_INPUT 1
#define BOARD_SWAY_INPUT 2
#define BOARD_BATTERY_INPUT 3

#define BOARD_GYRO_ZERO 512
#define BOARD_GYRO_PER_COUNT_Q8 5235 /* 2.5 V are 600 degrees/s, 10.47 rad/s */
#define BOARD_GYRO_REVERSED 0
#define BOARD_SURGE_ZERO 512
#define BOARD_SURGE_PER_COUNT_Q8 9810 /* 2.5 V are 2 g, 19.62 m/s^2 */
#define BOARD_SURGE_REVERSED 0
#define BOARD_SWAY_ZERO 512
#define BOARD_SWAY_PER_COUNT_Q8 9810
#define BOARD_SWAY_REVERSED 0

/* The battery, through a divider of 30 kilohm to it and 10 kilohm to ground: 5 V at the input are 20 V. */
#define BOARD_BATTERY_FULL_MV 20000

/* The host's line: UART 0, 8 bits, no parity. At 16 MHz it has 117,647 baud, 2.1 % more, as on every Arduino. */
#define BOARD_BAUD 115200UL

/* Timer 2 counts milliseconds. A tick begins every BOARD_TICK_MS. */
#ifndef BOARD_TICK_MS
#define BOARD_TICK_MS 3
#endif

#endif
