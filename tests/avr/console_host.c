/* console_host CHIP PROGRAM.elf: runs a program of console.c on simavr's chip: atmega328p, atmega2560. Its UART 0 is the standard output.
 * The exit status is the program's own; 124 if it has not ended after an hour of its time, 125 if the chip crashed.
 */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

enum { GPIOR0 = 0x3E, ENDLESS = 124, CRASHED = 125, BAD_USE = 2 };
#define HZ 16000000UL
#define MOST_CYCLES (3600ULL * HZ)

static void put(struct avr_irq_t *irq, uint32_t byte, void *unused)
{
    (void)irq;
    (void)unused;
    putchar((int)byte);
}

/* simavr would wait in real time. */
static void sleep_without_waiting(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    (void)cycles;
}

/* simavr says on standard output what it loads. */
static void say_errors(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level <= LOG_ERROR)
        (void)vfprintf(stderr, format, arguments);
}

static avr_t *start(const char *chip, const char *program)
{
    elf_firmware_t firmware;
    avr_t *avr;
    uint32_t flags = 0;

    avr_global_logger_set(say_errors);
    memset(&firmware, 0, sizeof firmware);
    if (elf_read_firmware(program, &firmware) != 0 || (avr = avr_make_mcu_by_name(chip)) == NULL)
        return NULL;
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    avr->frequency = HZ;
    avr->sleep = sleep_without_waiting;
    (void)avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)AVR_UART_FLAG_STDIO;
    (void)avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), put, NULL);
    return avr;
}

int main(int argc, char **argv)
{
    avr_t *avr;
    int state;

    if (argc != 3 || (avr = start(argv[1], argv[2])) == NULL) {
        fprintf(stderr, "CHIP PROGRAM.elf: no such chip or program\n");
        return BAD_USE;
    }
    do
        state = avr_run(avr);
    while (state != cpu_Done && state != cpu_Crashed && avr->cycle < MOST_CYCLES);
    if (state == cpu_Crashed)
        return CRASHED;
    return state == cpu_Done ? avr->data[GPIOR0] : ENDLESS;
}
