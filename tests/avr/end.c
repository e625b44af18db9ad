/* end.c: the end of a test program on an AVR chip. Its status goes to GPIOR0, where the simulator's program finds it. */
#include <avr/io.h>

/* exit() runs this; its argument is in r24 still. Once UART 0 has taken the last byte, the chip sleeps for ever. */
__attribute__((naked, used, section(".fini8"))) static void end(void)
{
    __asm__ volatile("out %0, r24" ::"I"(_SFR_IO_ADDR(GPIOR0)));
    while ((UCSR0A & 1U << UDRE0) == 0) {
    }
    __asm__ volatile("cli\n\tsleep");
}
