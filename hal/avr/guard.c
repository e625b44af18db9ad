#include "avr/guard.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "avr/motors.h"

/* What avrdude burns: a crystal at its full speed, no boot loader, and the brown-out detector at 4.3 V, which the sensors' 5 V need.
 * A library of Arduino has none: a boot loader cannot write them. */
#ifndef BRICKPILOT_LIBRARY
FUSES = {
    .low = 0xFF,
    .high = FUSE_SPIEN & FUSE_BOOTSZ0 & FUSE_BOOTSZ1,
    .extended = FUSE_BODLEVEL0 & FUSE_BODLEVEL1,
};
#endif

#define CANARY 0xA5C3U

/* The stack grows down to here. */
extern uint16_t __heap_start;

static uint8_t cause __attribute__((section(".noinit")));

/* Runs before the variables are cleared. After a watchdog reset the watchdog is on, at 15 ms. The boot loader of Arduinos clears
 * MCUSR and leaves what it was in r2. */
__attribute__((naked, used, section(".init3"))) static void keep_cause(void)
{
    register uint8_t from_loader __asm__("r2");

    __asm__ volatile("" : "=r"(from_loader));
    cause = MCUSR != 0 ? MCUSR : from_loader & (1U << WDRF | 1U << BORF | 1U << EXTRF | 1U << PORF);
    MCUSR = 0;
    wdt_disable();
}

uint8_t guard_cause(void)
{
    return cause;
}

bool guard_failed(void)
{
    return (cause & GUARD_WATCHDOG) != 0 || (cause & (GUARD_BROWN_OUT | GUARD_POWER_ON)) == GUARD_BROWN_OUT;
}

void guard_start(void)
{
    __heap_start = CANARY;
    wdt_enable(WDTO_30MS);
}

void guard_tick(void)
{
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
