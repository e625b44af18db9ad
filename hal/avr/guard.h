/* guard.h: finds out why the chip started, and resets the chip when the program fails.
 *
 * Every reset makes all pins inputs at once, and the pull-down resistors at the H-bridge then let both motors coast.
 * That is the safe state. Three causes lead to it: the watchdog, if guard_tick() is not called for GUARD_MS; the
 * brown-out detector, below 4.3 V; and an unexpected interrupt or a stack overflow, after which the watchdog resets the
 * chip.
 */
#ifndef BRICKPILOT_AVR_GUARD_H
#define BRICKPILOT_AVR_GUARD_H

#include <stdbool.h>
#include <stdint.h>

/* Time-out of the watchdog. Its oscillator is accurate to a tenth. */
enum { GUARD_MS = 30 };

/* Bits of guard_cause(), the same as in MCUSR. */
enum { GUARD_POWER_ON = 1, GUARD_RESET_PIN = 2, GUARD_BROWN_OUT = 4, GUARD_WATCHDOG = 8 };

/* Returns why the chip started. More than one bit may be set: a slow rise of the supply is a power-on and a brown-out.
 * Returns 0 if a boot loader has cleared MCUSR, as Arduino loaders do. */
uint8_t guard_cause(void);

/* True after power-on, and after a push of the reset button if MCUSR shows the reset pin alone: only then may a robot
 * drive off by itself. A start is a power-on if RAM holds no mark of guard_start(), and MCUSR shows nothing, or a
 * power-on and no watchdog. RAM may keep the mark for some seconds without supply: then the robot waits for a command.
 * With a loader that clears MCUSR, the button cannot be told from the watchdog. */
bool guard_may_start(void);

/* Starts the watchdog, and marks in RAM that the program runs and that motors may be on. From then on guard_tick() has
 * to be called in every tick. */
void guard_start(void);
void guard_tick(void);

#endif
