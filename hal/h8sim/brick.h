/* brick.h: an RCX in simulated time. decoded.h calls it from the simulator's main loop. */
#ifndef BRICKPILOT_H8SIM_BRICK_H
#define BRICKPILOT_H8SIM_BRICK_H

#include "chip.h"
#include "console.h"
#include "processor.h"

enum { EXIT_R1 = 0xDEAD, EXIT_R2 = 0xBEEF }; /* with these values a SLEEP ends the simulator */

static void brick_start(uint8_t *memory)
{
    chip_start(memory);
    chip.out = take_sent;
    hold(0);
}

static void sleep_until_next(void)
{
    const uint64_t then = earliest(chip.next, console.until);

    if (then <= chip.now)
        return;
    chip.spent[IDLE] += then - chip.now;
    chip.now = then;
}

/* Lets time pass until the instruction at `pc` runs, and counts it. Returns the interrupt that comes instead, or 0. */
static int brick_before(uint16_t pc, bool masked, const uint16_t *registers)
{
    const bool sleeps = word_at(pc) == SLEEP && !(registers[1] == EXIT_R1 && registers[2] == EXIT_R2);
    int kind;

    console_poll();
    while ((kind = interrupt_now(masked)) == 0 && sleeps) {
        processor.before = 0;
        sleep_until_next();
        console_poll();
    }
    if (kind == 0) {
        keep_time(pc);
        count_instruction(pc, registers);
    }
    return kind;
}

/* Takes an interrupt before the instruction at `pc`. Moves the stack pointer. Returns the address of the handler. */
static uint16_t brick_interrupt(int kind, uint16_t pc, uint8_t conditions, uint16_t *stack)
{
    const bool slept = word_at(pc) == SLEEP;

    *stack = (uint16_t)(*stack - 4);
    put_word(*stack, (uint16_t)(conditions << 8 | conditions));
    put_word((uint16_t)(*stack + 2), (uint16_t)(slept ? pc + 2 : pc));
    processor.before = 0;
    return word_at(enter(kind, *stack));
}

#endif
