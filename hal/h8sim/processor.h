/* processor.h: how long the RCX's processor takes for an instruction, and how it takes interrupts. Source: Hitachi
 * H8/300 Series Programming Manual, appendix A, and the chapter on exceptions of the H8/3297 Series Hardware Manual.
 *
 * states_gen.h lists the memory accesses of each instruction. This file knows their addresses, so each access gets the
 * time of its memory. ROM and RAM on the chip take 2 states for a byte or a word. All else (the RCX's RAM and its motor
 * port on the 8-bit bus, the chip's own registers) takes 3 states for a byte and 6 for a word. No device of the RCX
 * asks for wait states. All words of code are timed by the memory of the instruction, even the first word after a jump
 * to other memory. */
#ifndef BRICKPILOT_H8SIM_PROCESSOR_H
#define BRICKPILOT_H8SIM_PROCESSOR_H

#include "chip.h"
#include "states_gen.h"

enum { SLEEP = 0x0180, RTE = 0x56, EEPMOV = 0x7B, STACK = 7 };
enum { ROM_END = 0x4000, RAM_BEGIN = 0xFD80, RAM_END = 0xFF80 }; /* on the chip */
enum { PROGRAMS_BEGIN = 0xADBC };  /* where brickOS's memory for programs begins; the kernel lies below */
enum { DECIDE = 2, INTERNAL = 4 }; /* states of an interrupt in addition to its memory accesses */

static struct {
    int depth; /* 0: a task runs, 1: an interrupt, 2: an NMI in an interrupt */
    int kinds[3];
    uint8_t before; /* first byte of the last instruction */
} processor;

static bool on_chip(uint16_t address)
{
    return address < ROM_END || (address >= RAM_BEGIN && address < RAM_END);
}

static unsigned word_states(uint16_t address)
{
    return on_chip(address) ? 2 : 6;
}

static unsigned byte_access_states(uint16_t address)
{
    return on_chip(address) ? 2 : 3;
}

/* The address of the instruction's data; the stack pointer if the data are on the stack. `registers` has r0 to r7. */
static uint16_t data_address(const uint8_t *code, const uint16_t *registers)
{
    const instruction_t *const cost = &INSTRUCTIONS[code[0]];
    const uint16_t base = registers[code[1] >> 4 & 7];

    switch (cost->where) {
    case AT_STACK:
        return registers[STACK];
    case AT_REGISTER:
        return base;
    case AT_SHORT:
        return (uint16_t)(0xFF00 | code[1]);
    case AT_WORD:
        return (uint16_t)(code[2] << 8 | code[3]);
    case AT_DISPLACED:
        return (uint16_t)(base + (code[2] << 8 | code[3]));
    case AT_STEPPED:
        return (uint16_t)(code[1] & 0x80 ? base - (cost->words > 0 ? 2 : 1) : base);
    default:
        return 0;
    }
}

/* Returns the states of the instruction at `pc`. Tells the chip which register the instruction reads or writes. */
static unsigned instruction_states(uint16_t pc, const uint16_t *registers)
{
    const uint8_t *const code = &chip.memory[pc];
    const instruction_t *const cost = &INSTRUCTIONS[code[0]];
    const uint16_t at = data_address(code, registers);

    if (code[0] == EEPMOV) {
        const uint8_t bytes = (uint8_t)(registers[4] & 0xFF);
        return 2 * word_states(pc) +
               (bytes + 1U) * (byte_access_states(registers[5]) + byte_access_states(registers[6])) + 1;
    }
    if (cost->where != AT_NOTHING)
        chip_touch(at);
    return cost->code * word_states(pc) + cost->words * word_states(at) + cost->bytes * byte_access_states(at) +
           cost->own;
}

/* Adds states to the time, and to the sum of the kind (program, kernel or interrupt) that runs at `pc`. */
static void spend(unsigned states, uint16_t pc)
{
    const int task = pc >= PROGRAMS_BEGIN && pc < RAM_BEGIN ? PROGRAM : KERNEL;

    chip.now += states;
    chip.spent[processor.depth > 0 ? processor.kinds[processor.depth] : task] += states;
}

/* Lets the devices run. Returns the interrupt that comes before the next instruction, or 0. After an instruction that
 * changes the interrupt mask (LDC, ORC, XORC, ANDC) the next instruction always comes first. */
static int interrupt_now(bool masked)
{
    if (chip.touched != 0)
        chip_written();
    if (chip.now >= chip.next)
        chip_run();
    if (processor.before >= 0x03 && processor.before <= 0x07)
        return 0;
    if (chip.nmi) {
        chip.nmi = false;
        return NMI;
    }
    return masked ? 0 : chip.pending;
}

/* Counts the interrupt and its time. Returns the address of its vector. */
static uint16_t enter(int kind, uint16_t stack)
{
    const uint16_t vector = (uint16_t)(2 * (kind == NMI ? 3 : INTERRUPTS[kind].vector));

    if (processor.depth < 2)
        processor.depth++;
    processor.kinds[processor.depth] = kind;
    chip.count[kind]++;
    spend(DECIDE + 2 * word_states(stack) + word_states(vector) + 2 * word_states(word_at(vector)) + INTERNAL, 0);
    return vector;
}

/* Adds the time of the instruction at `pc`. */
static void count_instruction(uint16_t pc, const uint16_t *registers)
{
    spend(instruction_states(pc, registers), pc);
    processor.before = chip.memory[pc];
    if (processor.before == RTE && processor.depth > 0)
        processor.depth--;
}

#endif
