/* console.c: the ends of a program that is no more than main(): its output goes to UART 0, and its status to tests/avr/run.c. */
#include <avr/io.h>
#include <avr/sleep.h>
#include <unistd.h>

int write(int descriptor, const void *bytes, size_t size)
{
    const char *byte = bytes;

    (void)descriptor;
    UCSR0B = 1U << TXEN0;
    for (size_t left = size; left > 0; left--) {
        while ((UCSR0A & 1U << UDRE0) == 0) {
        }
        UDR0 = *byte++;
    }
    UCSR0A = 1U << TXC0;
    return (int)size;
}

/* exit() runs this. Its argument is in r24 still. To sleep with interrupts off ends the simulation, after the last byte has left. */
__attribute__((naked, used, section(".fini8"))) static void end(void)
{
    __asm__ volatile("out %0, r24" ::"I"(_SFR_IO_ADDR(GPIOR0)));
    while ((UCSR0A & 1U << UDRE0) == 0) {
    }
    __asm__ volatile("cli\n\tsleep");
}
