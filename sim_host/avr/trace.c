/* trace.c: writes the signals at the processor's pins to a VCD file, with simavr's own writer. */
#include <stdio.h>

#include "avr/chip.h"

enum {
    OF_MOTORS,
    OF_ENCODERS = SIDES * MOTOR_PINS,
    OF_ANALOG = OF_ENCODERS + 2 * SIDES,
    OF_RESET = OF_ANALOG + ANALOG_COUNT
};
enum { SIGNALS = OF_RESET + 1, FLUSH_US = 10000 };

static const char *NAMES[SIGNALS] = {"left_pwm",  "left_in1", "left_in2", "right_pwm", "right_in1",
                                     "right_in2", "left_a",   "left_b",   "right_a",   "right_b",
                                     "gyro",      "surge",    "sway",     "battery",   "in_brown_out"};

bool trace_open(chip_t *chip, const char *file)
{
    FILE *probe = fopen(file, "w");

    if (probe == NULL)
        return false;
    fclose(probe);
    chip->traced = avr_alloc_irq(&chip->avr->irq_pool, 0, SIGNALS, NAMES);
    avr_vcd_init(chip->avr, file, &chip->vcd, FLUSH_US);
    for (int i = 0; i < SIGNALS; i++)
        avr_vcd_add_signal(&chip->vcd, chip->traced + i, i >= OF_ANALOG && i < OF_RESET ? 10 : 1, NAMES[i]);
    return avr_vcd_start(&chip->vcd) == 0;
}

static void put(chip_t *chip, int signal, uint32_t value)
{
    if (chip->traced != NULL && chip->traced[signal].value != value)
        avr_raise_irq(chip->traced + signal, value);
}

void trace_signal(chip_t *chip, int side, int signal, uint32_t value)
{
    put(chip, OF_MOTORS + side * MOTOR_PINS + signal, value);
}

void trace_encoder(chip_t *chip, int side, bool a, bool b)
{
    put(chip, OF_ENCODERS + 2 * side, a);
    put(chip, OF_ENCODERS + 2 * side + 1, b);
}

void trace_analog(chip_t *chip, int input, uint32_t code)
{
    put(chip, OF_ANALOG + input, code);
}

void trace_reset(chip_t *chip, bool in_reset)
{
    put(chip, OF_RESET, in_reset);
}

void trace_close(chip_t *chip)
{
    if (chip->traced == NULL)
        return;
    avr_vcd_close(&chip->vcd);
    avr_free_irq(chip->traced, SIGNALS);
    chip->traced = NULL;
}
