/* motors.h: two motors behind H-bridges, on the PWM of timer 1. hal_motors_write() drives them; duty 0 is a brake. */
#ifndef BRICKPILOT_AVR_MOTORS_H
#define BRICKPILOT_AVR_MOTORS_H

/* Starts the PWM. The motors coast. */
void motors_start(void);

/* Switches the current off: the safe state. It may also be called in an interrupt. */
void motors_coast(void);

#endif
