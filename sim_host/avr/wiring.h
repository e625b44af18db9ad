/* wiring.h: hal/avr/board.h as data, for either chip: the device at each pin, and the scale of each analogue input. */
#ifndef BRICKPILOT_SIM_AVR_WIRING_H
#define BRICKPILOT_SIM_AVR_WIRING_H

#include <stdbool.h>

enum { LEFT, RIGHT, SIDES };
enum { PIN_PWM, PIN_IN1, PIN_IN2, MOTOR_PINS };
enum { ANALOG_GYRO, ANALOG_SURGE, ANALOG_SWAY, ANALOG_BATTERY, ANALOG_COUNT };

typedef struct {
    char port; /* 'A'.. */
    int bit;
} wiring_pin_t;

/* The converter's reading is zero + value / per_count, in counts; 1024 counts are the full range. */
typedef struct {
    int input; /* number of the converter's input */
    double zero;
    double per_count; /* rad/s, m/s^2 or V per count; negative: wired the other way round */
} wiring_analog_t;

typedef struct {
    const char *chip; /* simavr's name of the chip */
    wiring_pin_t motor[SIDES][MOTOR_PINS];
    wiring_pin_t encoder[SIDES][2];      /* A, B */
    bool reversed[SIDES];                /* B leads A in forward motion */
    wiring_pin_t bus_clock;              /* clock pin of the I2C bus */
    unsigned char pin_change_mask;       /* data address of the mask register of the encoders' port */
    unsigned char pin_change_vector;     /* number of that port's pin-change interrupt */
    unsigned short largest_boot_section; /* bytes */
    wiring_analog_t analog[ANALOG_COUNT];
} wiring_t;

extern const wiring_t WIRING_328P, WIRING_2560;

#endif
