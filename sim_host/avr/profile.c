#include "avr/profile.h"

enum { STEP = 0, INTERRUPT = BP_AVR_PARTS, NONE };

static uint8_t part_now(const profile_t *profile)
{
    return profile->frames == 0 ? NONE : profile->frame[profile->frames - 1].part;
}

static void count(profile_t *profile, uint64_t cycle)
{
    const uint32_t passed = (uint32_t)(cycle - profile->now);
    const uint8_t part = part_now(profile);

    profile->row.awake += passed;
    if (part == INTERRUPT)
        profile->row.interrupts += passed;
    else if (part != NONE)
        profile->row.part[part] += passed;
}

static void end_step(profile_t *profile)
{
    if (profile->ended < profile->room)
        profile->rows[profile->ended++] = profile->row;
    profile->row = (bp_avr_costs){.awake = 0};
}

static void leave(profile_t *profile, uint16_t stack)
{
    while (profile->frames > 0 && stack > profile->frame[profile->frames - 1].stack)
        if (profile->frame[--profile->frames].part == STEP)
            end_step(profile);
}

static void enter(profile_t *profile, uint8_t part, uint16_t stack)
{
    const uint8_t within = part_now(profile);
    const bool counts = part == INTERRUPT ? within != INTERRUPT : within == NONE || within == STEP;

    if (counts && profile->frames < PROFILE_FRAMES)
        profile->frame[profile->frames++] = (profile_frame_t){.part = part, .stack = stack};
}

void profile_look(profile_t *profile, uint64_t cycle, uint32_t next, uint16_t stack, bool asleep)
{
    if (!asleep)
        count(profile, cycle);
    profile->now = cycle;
    if (stack < profile->lowest_stack)
        profile->lowest_stack = stack;
    leave(profile, stack);
    if (next > 0 && next < profile->vectors_end) {
        enter(profile, INTERRUPT, stack);
        return;
    }
    for (int i = 0; i < profile->functions; i++)
        if (profile->function[i].entry == next)
            enter(profile, (uint8_t)profile->function[i].part, stack);
}
