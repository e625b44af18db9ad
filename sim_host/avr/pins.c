/* pins.c: the devices at the processor's pins. */
#include <math.h>
#include <simavr/avr_ioport.h>

#include "avr/chip.h"

enum { GLITCH_CYCLES = 320 }; /* 20 us: longer than an interrupt's latency, so that the program sees the pulse */

static avr_ioport_t *port_of(const chip_t *chip, wiring_pin_t pin)
{
    return chip->port[pin.port - 'A'];
}

/* The level that the port drives. If the pin is an input, its pull-down resistor makes the level low. */
static bool port_level(const chip_t *chip, wiring_pin_t pin)
{
    const avr_ioport_t *port = port_of(chip, pin);
    return (chip->avr->data[port->r_ddr] & chip->avr->data[port->r_port]) >> pin.bit & 1;
}

/* The level of a PWM pin. On the chip, a connected timer output drives the pin, whatever the port says; in simavr a
 * write to the port changes the pin. With the compare value at the counter's top the output never changes; simavr sets
 * it to the wrong level. */
static bool pwm_level(const chip_t *chip, int side)
{
    const wiring_pin_t pin = chip->wiring->motor[side][PIN_PWM];
    const avr_timer_comp_t *compare = &chip->pwm_timer->comp[side];
    const uint8_t *data = chip->avr->data;
    const uint8_t mode = avr_regbit_get(chip->avr, compare->com);
    const unsigned value = data[compare->r_ocr] | (unsigned)data[compare->r_ocrh] << 8;

    if (mode == avr_timer_com_normal)
        return port_level(chip, pin);
    if ((data[port_of(chip, pin)->r_ddr] >> pin.bit & 1) == 0)
        return false;
    if (chip->pwm_timer->mode.kind == avr_timer_wgm_fast_pwm && value >= chip->pwm_timer->tov_top)
        return mode == avr_timer_com_clear;
    return chip->compare[side];
}

void pins_look(chip_t *chip)
{
    for (int side = 0; side < SIDES; side++) {
        const wiring_pin_t *pin = chip->wiring->motor[side];
        const bool in1 = port_level(chip, pin[PIN_IN1]), in2 = port_level(chip, pin[PIN_IN2]);
        const bool pwm = pwm_level(chip, side);
        bridge_set(&chip->bridge[side], bridge_state(in1, in2, pwm), chip->avr->cycle);
        trace_signal(chip, side, PIN_PWM, pwm);
        trace_signal(chip, side, PIN_IN1, in1);
        trace_signal(chip, side, PIN_IN2, in2);
    }
}

static void on_register(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    pins_look(param);
}

static void on_compare(avr_irq_t *irq, uint32_t value, void *param)
{
    chip_t *chip = param;
    chip->compare[irq->irq - TIMER_IRQ_OUT_COMP] = value & 1;
    pins_look(chip);
}

/* A conversion samples its input when it starts. simavr divides the reference by 1023 and takes whole millivolts; the
 * chip divides it by 1024. So this function gives simavr the millivolts for which its result equals the chip's. */
static void on_conversion(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    pins_convert(param);
}

void pins_convert(chip_t *chip)
{
    const uint32_t reference_mv = chip->avr->avcc;

    for (int i = 0; i < ANALOG_COUNT; i++) {
        const double counts = floor(chip->volts[i] / (reference_mv * 1e-3) * 1024);
        const uint32_t code = counts < 0 || isnan(counts) ? 0 : counts > 1023 ? 1023 : (uint32_t)counts;
        const uint32_t millivolts = (code * reference_mv + 1022) / 1023;
        const int input = chip->wiring->analog[i].input;
        avr_raise_irq(chip->adc->io.irq + ADC_IRQ_ADC0 + input, millivolts);
        trace_analog(chip, i, code);
    }
}

/* Follows the clock line of the I2C bus while the program pulses it by hand. */
static void on_bus_pin(avr_irq_t *irq, uint32_t value, void *param)
{
    chip_t *chip = param;

    (void)irq;
    chip_clock_bus(chip, value >> chip->wiring->bus_clock.bit & 1);
}

static void watch(chip_t *chip, avr_io_addr_t address)
{
    avr_irq_register_notify(avr_iomem_getirq(chip->avr, address, NULL, AVR_IOMEM_IRQ_ALL), on_register, chip);
}

/* Adds the pin-change interrupt of the ATmega2560's port K, which simavr 1.6 lacks. */
static void complete_pin_change(chip_t *chip)
{
    enum { PCIFR = 0x3B, PCICR = 0x68, GROUP = 2 };
    avr_ioport_t *port = port_of(chip, chip->wiring->encoder[LEFT][0]);

    if (port->r_pcint != 0)
        return;
    port->r_pcint = chip->wiring->pin_change_mask;
    port->pcint = (avr_int_vector_t){.vector = chip->wiring->pin_change_vector,
                                     .enable = AVR_IO_REGBIT(PCICR, GROUP),
                                     .raised = AVR_IO_REGBIT(PCIFR, GROUP)};
    avr_register_vector(chip->avr, &port->pcint);
}

void pins_connect(chip_t *chip)
{
    const avr_timer_t *timer = chip->pwm_timer;

    complete_pin_change(chip);
    for (int side = 0; side < SIDES; side++) {
        chip->encoder[side] = (chip_encoder_t){.chip = chip, .side = side};
        for (int i = 0; i < MOTOR_PINS; i++) {
            watch(chip, port_of(chip, chip->wiring->motor[side][i])->r_port);
            watch(chip, port_of(chip, chip->wiring->motor[side][i])->r_ddr);
        }
        watch(chip, timer->comp[side].r_ocr);
        avr_irq_register_notify(timer->io.irq + TIMER_IRQ_OUT_COMP + side, on_compare, chip);
    }
    avr_irq_register_notify(
        avr_iomem_getirq(chip->avr, port_of(chip, chip->wiring->bus_clock)->r_ddr, NULL, AVR_IOMEM_IRQ_ALL), on_bus_pin,
        chip);
    watch(chip, timer->comp[LEFT].com.reg); /* both outputs' modes */
    avr_irq_register_notify(chip->adc->io.irq + ADC_IRQ_OUT_TRIGGER, on_conversion, chip);
    for (int side = 0; side < SIDES; side++)
        pins_encoder(chip, side);
}

/* Drives a pin from outside. simavr's ports put a pull-up's level on every input when the port is written, unless they are told
 * that something else drives the pin. */
static void drive(chip_t *chip, wiring_pin_t pin, bool level)
{
    avr_ioport_t *port = port_of(chip, pin);
    const unsigned mask = 1U << pin.bit;

    port->external.pull_mask = (uint8_t)(port->external.pull_mask | mask);
    port->external.pull_value = (uint8_t)((port->external.pull_value & ~mask) | (level ? mask : 0));
    avr_raise_irq(port->io.irq + pin.bit, level);
}

void pins_encoder(chip_t *chip, int side)
{
    const chip_encoder_t *encoder = &chip->encoder[side];
    const int64_t count = chip->wiring->reversed[side] ? -encoder->count : encoder->count;
    const bool a = quadrature_a(count) != encoder->noise, b = quadrature_b(count);

    drive(chip, chip->wiring->encoder[side][0], a);
    drive(chip, chip->wiring->encoder[side][1], b);
    trace_encoder(chip, side, a, b);
}

/* Sets the input registers again: a reset clears them, but the levels at the pins have not changed. */
void pins_after_reset(chip_t *chip)
{
    for (int side = 0; side < SIDES; side++) {
        chip->compare[side] = false;
        for (int i = 0; i < 2; i++) {
            const wiring_pin_t pin = chip->wiring->encoder[side][i];
            const avr_ioport_t *port = port_of(chip, pin);
            if (port->external.pull_value >> pin.bit & 1)
                chip->avr->data[port->r_pin] = (uint8_t)(chip->avr->data[port->r_pin] | 1U << pin.bit);
        }
    }
    pins_look(chip);
}

static avr_cycle_count_t make_noise(avr_t *avr, avr_cycle_count_t when, void *param)
{
    chip_t *chip = param;
    const double rate = chip->fault[CHIP_ENCODER_NOISE];
    const bool ends = chip->encoder[LEFT].noise;

    (void)avr;
    for (int side = 0; side < SIDES; side++) {
        chip->encoder[side].noise = !ends && rate > 0;
        pins_encoder(chip, side);
    }
    if (!ends && rate > 0)
        return when + GLITCH_CYCLES;
    return rate > 0 ? when + 1 + (avr_cycle_count_t)(-log(1 - random_uniform(&chip->random)) * CHIP_HZ / rate) : 0;
}

void pins_make_noise(chip_t *chip)
{
    if (chip->fault[CHIP_ENCODER_NOISE] > 0 || chip->encoder[LEFT].noise)
        avr_cycle_timer_register(chip->avr, 1, make_noise, chip);
}
