/* chip.h: the processor, simulated by simavr, with the devices at its pins: two H-bridges, two rotation sensors, four
 * analogue voltages, an MPU-6050 and an LSM6DS, the host's line, the supply.
 *
 * All times are cycles of the processor since power-on. Every signal changes at its own cycle; the processor sees the
 * change at the end of the present instruction. The same calls give the same bits. simavr 1.6 differs from the real
 * chips in a few places; chip.c, pins.c and line.c name each difference where they correct it.
 */
#ifndef BRICKPILOT_SIM_AVR_CHIP_H
#define BRICKPILOT_SIM_AVR_CHIP_H

#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_vcd_file.h>

#include "avr/bridge.h"
#include "avr/i2c_imu.h"
#include "avr/profile.h"
#include "avr/quadrature.h"
#include "avr/wiring.h"
#include "sensors/random.h"

enum { CHIP_HZ = 16000000, LINE_ROOM = 8192 };

/* Faults of the chip or its surroundings, except for the supply. */
typedef enum {
    CHIP_MAIN_HELD,       /* the main program stands still; interrupts are served */
    CHIP_INTERRUPT_STUCK, /* the converter's interrupt comes again as soon as it has returned */
    CHIP_CONVERTER_STUCK, /* a conversion never ends */
    CHIP_LINE_OVERRUN,    /* fraction of the received bytes, 0..1, that come when the receiver is full */
    CHIP_ENCODER_NOISE,   /* false pulses per second on signal A of each rotation sensor */
    CHIP_RESET_PIN,       /* the reset pin is low, by its button or by the host's DTR */
    CHIP_IMU_UNPOWERED,   /* the digital IMUs have no supply; when it returns, they start as after power-on */
    CHIP_BUS_HELD,        /* the I2C bus' data line is low until the clock line has pulsed nine times */
    CHIP_FAULTS
} chip_fault_t;

typedef struct {
    uint8_t bytes[LINE_ROOM];
    uint32_t first, size;
} chip_queue_t;

typedef struct chip chip_t;

/* One rotation sensor. */
typedef struct {
    chip_t *chip;
    int side;
    int64_t count;
    quadrature_track_t track;
    uint64_t began; /* cycle of the track's start */
    bool noise;     /* a false pulse inverts signal A now */
} chip_encoder_t;

struct chip {
    avr_t *avr;
    const wiring_t *wiring;
    avr_io_t hook; /* our entry in simavr's list of devices: its function is called at a reset */
    avr_ioport_t *port[26];
    avr_timer_t *pwm_timer;
    avr_uart_t *uart;
    avr_adc_t *adc;
    avr_twi_t *twi;
    avr_regbit_t converter_enable; /* copy of adc->aden while the fault CHIP_CONVERTER_STUCK hides it */
    avr_regbit_t bus_enable;       /* copy of twi->twen while a device holds the bus */
    bool clock_was_low;            /* the I2C bus' clock line was low at its pin */
    int clocks;                    /* pulses of the clock line since the bus was held */

    bridge_t bridge[SIDES];
    bool compare[SIDES]; /* level of the timer's own output, before the port */
    chip_encoder_t encoder[SIDES];
    double volts[ANALOG_COUNT];
    i2c_imu_t imu[I2C_IMUS];

    double supply_v; /* V: supply of the processor */
    bool unpowered;
    chip_queue_t in, out;
    double fault[CHIP_FAULTS]; /* 0: the fault is absent */
    random_t random;

    uint32_t resets;   /* resets by the processor's watchdog, its brown-out detector or its pin */
    uint32_t overruns; /* bytes that the receiver lost */
    uint32_t lost_out; /* bytes to the host that found no room in `out` */

    profile_t *profile; /* NULL: none. It belongs to the owner; chip_profile() sets it */

    uint32_t step_cycles;
    uint64_t next_step;
    void (*on_step)(void *owner);
    void *owner;

    avr_vcd_t vcd;
    avr_irq_t *traced; /* NULL: no trace */
};

typedef enum { CHIP_OK, CHIP_BAD_IMAGE, CHIP_UNKNOWN, CHIP_TOO_LARGE, CHIP_BAD_TRACE } chip_status_t;

/* Loads an ELF image and powers the processor. The image's fuses also say whether a reset begins in the boot section.
 * `chip` must not move in memory until chip_close(), which the caller calls even after a failure. `trace`: a file to
 * which the signals are written as VCD; NULL: none.
 * chip_every() lets `on_step(owner)` be called exactly every step_cycles cycles, after the bridges' cycles are
 * counted. */
chip_status_t chip_open(chip_t *chip, const wiring_t *wiring, const char *image, const char *trace);
void chip_every(chip_t *chip, uint32_t step_cycles, void (*on_step)(void *owner), void *owner);
void chip_close(chip_t *chip);

/* Runs until the next on_step() has returned. */
void chip_run_step(chip_t *chip);

/* Sets how a wheel turns from now until the next step. */
void chip_turn(chip_t *chip, int side, const quadrature_track_t *track);

/* Sets the battery's voltage; the robot's 5 V regulator feeds the processor from it. Below the level of the brown-out
 * detector, the processor stays in reset. Without a detector it stops where it is; pins and timers stay as they are. */
void chip_supply(chip_t *chip, double battery_v);

/* Counts cycles into `profile` from now on. `profile` still belongs to the caller. */
void chip_profile(chip_t *chip, profile_t *profile);

void chip_set_fault(chip_t *chip, chip_fault_t fault, double value);

/* True if the processor has met an invalid instruction, or sleeps with interrupts off. Only its watchdog restarts
 * it. */
bool chip_has_stopped(const chip_t *chip);

/* Tells the chip the level of the bus' clock line. */
void chip_clock_bus(chip_t *chip, bool low);

bool queue_put(chip_queue_t *queue, uint8_t byte); /* false: no room */
bool queue_take(chip_queue_t *queue, uint8_t *byte);

/* pins.c */
void pins_connect(chip_t *chip);
void pins_after_reset(chip_t *chip);
void pins_look(chip_t *chip); /* sets the bridges' states from the levels of the pins */
void pins_encoder(chip_t *chip, int side);
void pins_convert(chip_t *chip);
void pins_make_noise(chip_t *chip);

/* line.c */
void line_connect(chip_t *chip);
void line_keep_time(chip_t *chip);
void line_send(chip_t *chip); /* begins to send the bytes that wait in `in` */

/* trace.c */
bool trace_open(chip_t *chip, const char *file);
void trace_signal(chip_t *chip, int side, int signal, uint32_t value);
void trace_encoder(chip_t *chip, int side, bool a, bool b);
void trace_analog(chip_t *chip, int input, uint32_t code); /* code: the converter's result, 0..1023 */
void trace_reset(chip_t *chip, bool in_reset);
void trace_close(chip_t *chip);

#endif
