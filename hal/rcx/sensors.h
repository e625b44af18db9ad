/* sensors.h: the sensor inputs. The functions of hal.h read them. */
#ifndef BRICKPILOT_RCX_SENSORS_H
#define BRICKPILOT_RCX_SENSORS_H

/* Powers the inputs as board.h says, and sets the rotation counts to 0. Call it while the wheels are at rest. */
void sensors_start(void);

/* sensors_hold() holds the kernel's A/D converter while a control step runs; sensors_release() lets it go on before the
 * task waits. At the end of the converter's interrupt the kernel starts the next conversion. So the converter
 * interrupts 24,000 times a second, which takes 59 % of the processor's time, or 67 % with rotation sensors. While the
 * converter is held, the inputs keep their readings, and a rotation sensor must not advance by two counts.
 *
 * Bit 6 of ADCSR, at 0xFFE8, enables the interrupt. The kernel's handler writes this register too. Each function is a
 * single instruction, so the handler cannot interrupt it. If a conversion has ended, its interrupt comes at the
 * release. */
static inline void sensors_hold(void)
{
    __asm__ volatile("bclr #6,@0xe8:8");
}

static inline void sensors_release(void)
{
    __asm__ volatile("bset #6,@0xe8:8");
}

#endif
