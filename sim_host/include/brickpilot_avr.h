/* brickpilot_avr.h: a robot whose brick is an AVR: the plant, its sensors and drives, and an image on simavr. Python calls this
 * through cffi.
 *
 * Time is simulated, and nothing depends on the clock of this machine: the same calls give the same bits. The plant is
 * one motor step (0.3 ms) behind the processor: the bridges' output of a step moves the plant in the next step. cffi
 * reads this header and that of the plant unchanged, so it holds plain declarations only.
 */
#ifndef BRICKPILOT_AVR_H
#define BRICKPILOT_AVR_H

#include "brickpilot_sim.h"

typedef struct bp_avr bp_avr;

enum { BP_AVR_E_IMAGE = -20, BP_AVR_E_CHIP = -21, BP_AVR_E_TOO_LARGE = -22, BP_AVR_E_TRACE = -23 };

/* Powers the brick with an ELF image, whose fuses may let a reset begin in a boot loader. `chip` is "atmega328p" or
 * "atmega2560", wired as in hal/avr/board.h. `request` is one of bp_fly() for a mission, and is used as in
 * bp_loop_open(); its model and arrays must outlive the brick. `trace`: a VCD file of the signals at the pins, or NULL.
 * Returns NULL on failure: then `status` holds a BP_E_ or BP_AVR_E_ code. */
bp_avr *bp_avr_open(const bp_flight *request, const char *image, const char *chip, const char *trace, int *status);
void bp_avr_close(bp_avr *brick);

/* Sets what one count of 1024 means at an input of the converter, in rad/s, m/s^2 or V, for an image with scales of its
 * own; negative: wired the other way round. Call it before bp_avr_wait(). Returns 0, or BP_E_RANGE. */
enum { BP_AVR_GYRO = 0, BP_AVR_SURGE = 1, BP_AVR_SWAY = 2, BP_AVR_BATTERY_INPUT = 3 };
int bp_avr_scale(bp_avr *brick, int input, double per_count);

/* Lets `motor_steps` motor steps pass before the flight begins; nothing is logged. Returns 0 or BP_E_. */
int bp_avr_wait(bp_avr *brick, int motor_steps);

/* Flies one control step (3 ms) and fills its row of the request's log and motors with what the drives did in it. The
 * controller's columns of the log stay 0. Returns 0, or BP_E_; BP_E_RANGE: the last step is over. */
int bp_avr_fly(bp_avr *brick);

/* The host's line. Bytes travel at the rate that the image has set. bp_avr_send() returns how many bytes found room;
 * bp_avr_receive() returns how many have come, at most `room`. */
int bp_avr_send(bp_avr *brick, const unsigned char *bytes, int count);
int bp_avr_receive(bp_avr *brick, unsigned char *bytes, int room);

/* Sets a fault from now on. The value switches it on (not 0) or off (0), or has the unit given here. */
enum {
    BP_AVR_MAIN_HELD = 0,       /* the main program stands still, interrupts are served */
    BP_AVR_INTERRUPT_STUCK = 1, /* the converter's interrupt comes again as soon as it has returned */
    BP_AVR_CONVERTER_STUCK = 2, /* a conversion never ends, even after the fault */
    BP_AVR_LINE_OVERRUN = 3,    /* fraction of the bytes to the brick that its receiver loses, 0..1 */
    BP_AVR_ENCODER_NOISE = 4,   /* false pulses per second, 20 us long, on signal A of both rotation sensors */
    BP_AVR_RESET_PIN = 5,       /* the reset pin is low: the button is held, or the host's DTR pulls it */
    BP_AVR_IMU_UNPOWERED = 6,   /* the digital IMUs have no supply; when it returns, they start as after power-on */
    BP_AVR_BUS_HELD = 7,        /* the I2C bus' data line is low until the clock line has pulsed nine times */
    BP_AVR_BATTERY = 8          /* battery voltage in V; 0: the model's voltage */
};
int bp_avr_fault(bp_avr *brick, int fault, double value); /* 0, or BP_E_RANGE */

/* Cycles of the program's parts. A part is a set of functions, given by their addresses (in bytes). The cycles from the
 * entry of such a function to its return count for the part, including the functions that it calls. Part 0 is the
 * control step: parts that it calls are counted separately, and so are interrupts. Parts that another part calls count
 * for the caller. */
enum { BP_AVR_PARTS = 16 };
typedef struct {
    unsigned int entry;
    int part; /* 0..BP_AVR_PARTS - 1 */
} bp_avr_function;

/* Cycles since the end of the previous control step. */
typedef struct {
    unsigned int part[16]; /* BP_AVR_PARTS */
    unsigned int interrupts;
    unsigned int awake; /* cycles in which the processor did not sleep */
} bp_avr_costs;

/* Counts cycles from now on. Each control step fills one of `rows` while there is room; bp_avr_tell() says how many are
 * filled. `rows` must outlive the brick. `vectors_end` is the first address behind the interrupts' vectors. Returns 0,
 * or BP_E_RANGE: a part, or too many functions. */
int bp_avr_profile(bp_avr *brick, const bp_avr_function *functions, int count, unsigned int vectors_end,
                   bp_avr_costs *rows, int room);

/* Report on the time since power-on. */
typedef struct {
    unsigned long long cycles;
    unsigned int resets;   /* by the watchdog, the brown-out detector or the reset pin */
    unsigned int overruns; /* bytes that the receiver lost */
    unsigned int lost;     /* bytes to the host that found no room */
    int stopped;           /* 1: the processor has stopped */
    int unpowered;         /* 1: its supply is too low */
    int profiled;          /* rows of bp_avr_profile() that are filled */
    int stack;             /* largest depth of the stack since bp_avr_profile(), bytes */
    double duty[2];        /* duty of the drives in the last motor step, -1..1; NaN: they coasted */
} bp_avr_report;
void bp_avr_tell(const bp_avr *brick, bp_avr_report *report);

/* Reads the processor's memory, for tests: returns 0, or BP_E_RANGE. Addresses are those of its data space. */
int bp_avr_read(const bp_avr *brick, int address, unsigned char *bytes, int count);

#endif
