/* profile.h: the processor's cycles in each part of its program for each control step, and the depth of its stack.
 *
 * A part is a set of functions, given by their addresses. The cycles from the entry of such a function to its return
 * count for the part, including the functions that it calls. Part 0 is the control step. If it calls another part,
 * these cycles count for that part only. Parts that another part calls count for the caller. Interrupts are counted
 * separately.
 */
#ifndef BRICKPILOT_SIM_AVR_PROFILE_H
#define BRICKPILOT_SIM_AVR_PROFILE_H

#include <stdbool.h>
#include <stdint.h>

#include "brickpilot_avr.h"

enum { PROFILE_FUNCTIONS = 64 };
enum { PROFILE_FRAMES = 4 }; /* for the step, a part in it, an interrupt, and one in reserve */

typedef struct {
    uint8_t part;
    uint16_t stack; /* stack pointer at the entry */
} profile_frame_t;

typedef struct {
    bp_avr_function function[PROFILE_FUNCTIONS];
    int functions;
    uint32_t vectors_end; /* the first address after the interrupt vectors */
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
