#include "avr/guard.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "avr/motors.h"

/* The fuses that avrdude writes: a crystal at full speed, no boot loader, and the brown-out detector at 4.3 V, because
 * the sensors need 5 V. A build as Arduino library has no fuses: a boot loader cannot write them. */
#ifndef BRICKPILOT_LIBRARY
FUSES = {
    .low = 0xFF,
    .high = FUSE_SPIEN & FUSE_BOOTSZ0 & FUSE_BOOTSZ1,
    .extended = FUSE_BODLEVEL0 & FUSE_BODLEVEL1,
};
#endif

#define CANARY 0xA5C3U

/* Lowest address that the stack may reach. */
extern uint16_t __heap_start;

#define ALIVE 0x6B95D2A4UL

/* The mark is not cleared at a start, so it outlives every reset and every boot loader: loaders use only the two ends
 * of RAM, and the mark lies between the variables and the stack. After power-on, RAM holds this pair with a
 * probability of 1 in 2^64. */
static struct {
    uint32_t alive, complement;
} mark __attribute__((section(".noinit")));

static uint8_t cause __attribute__((section(".noinit")));
static bool survived
    __attribute__((section(".noinit"))); /* the program had run before this start, and RAM kept its mark */

/* Runs before the variables are cleared. After a watchdog reset the watchdog is on, at 15 ms. A boot loader may have
 * cleared MCUSR: the loaders of Arduino's core do, and no register keeps a copy that can be trusted. */
__attribute__((naked, used, section(".init3"))) static void keep_cause(void)
{
    survived = mark.alive == ALIVE && mark.complement == ~ALIVE;
    cause = MCUSR & (GUARD_WATCHDOG | GUARD_BROWN_OUT | GUARD_RESET_PIN | GUARD_POWER_ON);
    MCUSR = 0;
    wdt_disable();
}

static void leave_mark(void)
{
    mark.alive = ALIVE;
    mark.complement = ~ALIVE;
}

uint8_t guard_cause(void)
{
    return cause;
}

bool guard_may_start(void)
{
    if (cause == GUARD_RESET_PIN)
        return true;
    return !survived && (cause == 0 || (cause & GUARD_POWER_ON) != 0) && (cause & GUARD_WATCHDOG) == 0;
}

void guard_start(void)
{
    __heap_start = CANARY;
    leave_mark();
    wdt_enable(WDTO_30MS);
}

void guard_tick(void)
{
    leave_mark(); /* written again in case the stack has overwritten it */
    if (__heap_start == CANARY)
        wdt_reset();
}

/* An interrupt without a handler. */
ISR(BADISR_vect)
{
    motors_coast();
    for (;;) {
    }
}
