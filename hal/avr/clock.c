#include "avr/clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <util/atomic.h>

#include "avr/analogue.h"
#include "avr/board.h"
#include "avr/digital.h"
#include "hal.h"

enum { PRESCALE = 64, TOP = BOARD_CPU_HZ / PRESCALE / 1000 - 1 };

_Static_assert(BOARD_TICK_MS > 1, "the digital IMU is read in the ms before a tick");

static volatile uint32_t now_ms;
static volatile uint8_t ticks; /* ticks that have begun and that clock_wait() has not returned yet; saturates at 255 */
static uint8_t until_tick = BOARD_TICK_MS;

ISR(TIMER2_COMPA_vect)
{
    now_ms++;
    if (--until_tick == 1)
        digital_begin();
    if (until_tick > 0)
        return;
    until_tick = BOARD_TICK_MS;
    if (ticks < 255)
        ticks++;
    digital_end();
    analogue_begin();
}

void clock_start(void)
{
    TCCR2A = 1U << WGM21; /* counts from 0 again after OCR2A */
    TCCR2B = 1U << CS22;  /* clock divided by 64 */
    OCR2A = TOP;
    TIMSK2 = 1U << OCIE2A;
}

uint32_t hal_clock_ms(void)
{
    uint32_t ms;

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        ms = now_ms;
    }
    return ms;
}

/* Sleeps until an interrupt, as the manual of avr/sleep.h says: no interrupt can come between sei() and the next
 * instruction, so the sleep misses no interrupt. Interrupts are off before and after. */
static void sleep_until_interrupt(void)
{
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
    cli();
}

uint8_t clock_wait(void)
{
    uint8_t begun;

    set_sleep_mode(SLEEP_MODE_IDLE);
    cli();
    while (ticks == 0)
        sleep_until_interrupt();
    begun = ticks;
    ticks = 0;
    sei();
    return begun;
}
