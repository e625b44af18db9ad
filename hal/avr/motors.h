/* motors.h: two motors on H-bridges, with the PWM of timer 1. hal_motors_write() drives the motors; duty 0 brakes. */
#ifndef BRICKPILOT_AVR_MOTORS_H
#define BRICKPILOT_AVR_MOTORS_H

/* Starts the PWM. The motors coast. */
void motors_start(void);

/* Lets the motors coast, without current: the safe state. May also be called in an interrupt. */
void motors_coast(void);

#endif
