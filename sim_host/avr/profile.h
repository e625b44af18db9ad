/* profile.h: cycles of the processor in each part of its program, step by step, and the depth of its stack.
 *
 * A part is a set of functions, given by their addresses. From the entry of such a function to its return the cycles
 * count for the part, with all that it calls. Part 0 is the control step: a part that it calls is counted apart, and
 * all else that it calls counts for part 0. What other parts call counts for them. Interrupts are counted apart.
 */
#ifndef BRICKPILOT_SIM_AVR_PROFILE_H
#define BRICKPILOT_SIM_AVR_PROFILE_H

#include <stdbool.h>
#include <stdint.h>

#include "brickpilot_avr.h"

enum { PROFILE_FUNCTIONS = 64 };
enum { PROFILE_FRAMES = 4 }; /* for the step, a part of it, an interrupt, and one to spare */

typedef struct {
    uint8_t part;
    uint16_t stack; /* stack pointer at the entry */
} profile_frame_t;

typedef struct {
    bp_avr_function function[PROFILE_FUNCTIONS];
    int functions;
    uint32_t vectors_end; /* the first address behind the interrupts' vectors */
    profile_frame_t frame[PROFILE_FRAMES];
    int frames;
    uint64_t now;          /* cycle up to which all is counted */
    uint16_t lowest_stack; /* the stack pointer's lowest value */
    bp_avr_costs row;
    bp_avr_costs *rows; /* rows of the steps that have ended; they belong to the caller */
    int room, ended;
} profile_t;

/* Counts the cycles since the last call, then looks at the next instruction. `asleep`: the processor has slept. */
void profile_look(profile_t *profile, uint64_t cycle, uint32_t next, uint16_t stack, bool asleep);

#endif
