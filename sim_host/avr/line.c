/* line.c: the host's end of UART 0. */
#include "avr/chip.h"

enum { BITS = 10, RECEIVER_HOLDS = 3 }; /* bytes that the receiver holds: two, and one in the shift register */

static void on_sent(avr_irq_t *irq, uint32_t value, void *param)
{
    chip_t *chip = param;

    (void)irq;
    if (!queue_put(&chip->out, (uint8_t)value))
        chip->lost_out++;
}

/* Corrects a byte's time: simavr counts a parity bit, which 8N1 lacks, and misses a U2X written after the rate. */
void line_keep_time(chip_t *chip)
{
    avr_uart_t *uart = chip->uart;
    const unsigned low = avr_regbit_get(chip->avr, uart->ubrrl), high = avr_regbit_get(chip->avr, uart->ubrrh);
    const unsigned per_bit = ((high << 8 | low) + 1) * (avr_regbit_get(chip->avr, uart->u2x) ? 8 : 16);

    uart->cycles_per_byte = per_bit * BITS;
}

static unsigned unread(const avr_uart_t *uart)
{
    return (unsigned)(uart->input.write - uart->input.read) % uart_fifo_fifo_size;
}

/* A byte begins to arrive. simavr's receiver holds 64 bytes; the real chip's receiver is full after three. */
static void receive(chip_t *chip, uint8_t byte)
{
    avr_uart_t *uart = chip->uart;
    const bool hit =
        chip->fault[CHIP_LINE_OVERRUN] > 0 && random_uniform(&chip->random) < chip->fault[CHIP_LINE_OVERRUN];

    if (hit || unread(uart) >= RECEIVER_HOLDS) {
        avr_regbit_set(chip->avr, uart->dor);
        chip->overruns++;
    } else {
        avr_regbit_clear(chip->avr, uart->dor);
        avr_raise_irq(uart->io.irq + UART_IRQ_INPUT, byte);
    }
}

static avr_cycle_count_t next_byte(avr_t *avr, avr_cycle_count_t when, void *param)
{
    chip_t *chip = param;
    uint8_t byte;

    (void)avr;
    line_keep_time(chip);
    if (!queue_take(&chip->in, &byte))
        return 0;
    receive(chip, byte);
    return when + chip->uart->cycles_per_byte;
}

void line_send(chip_t *chip)
{
    if (chip->in.size > 0 && avr_cycle_timer_status(chip->avr, next_byte, chip) == 0)
        avr_cycle_timer_register(chip->avr, 1, next_byte, chip);
}

void line_connect(chip_t *chip)
{
    uint32_t flags = 0; /* neither sleep in real time nor print */

    avr_ioctl(chip->avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(chip->uart->io.irq + UART_IRQ_OUTPUT, on_sent, chip);
}
