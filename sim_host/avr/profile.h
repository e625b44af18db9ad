/* profile.h: for how many cycles the processor is in which part of its program, step by step, and how deep its stack is.
 *
 * A part has functions, given by their addresses. From the entry of one of them to its return the cycles are the part's, with all that it
 * calls. Part 0 is the control step: what it calls may be a part of its own, and what is not stays with part 0. What other
 * parts call is theirs. Interrupts are apart from all of them.
 */
#ifndef BRICKPILOT_SIM_AVR_PROFILE_H
#define BRICKPILOT_SIM_AVR_PROFILE_H

#include <stdbool.h>
#include <stdint.h>

#include "brickpilot_avr.h"

enum { PROFILE_FUNCTIONS = 64 };
enum { PROFILE_FRAMES = 4 }; /* the step, a part of it, and an interrupt; one to spare */

typedef struct {
    uint8_t part;
    uint16_t stack; /* pointer at the entry */
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
    bp_avr_costs *rows; /* the caller's, of the steps that have ended */
    int room, ended;
} profile_t;

/* Counts what passed since the last call, then looks at the instruction that comes next. `asleep`: that time was slept. */
void profile_look(profile_t *profile, uint64_t cycle, uint32_t next, uint16_t stack, bool asleep);

#endif
