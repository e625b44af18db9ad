/* effect.h: one effect: its row of the table, and the functions that make it act.
 *
 * An effect is something that the nominal model lacks. To add one:
 *   1. write NAME.c in this folder. It defines `const effect_t effect_NAME`: the row, and a hook for each site where
 *      the effect acts. brickpilot_sim.h explains every field of the row.
 *   2. add EFFECT(NAME) to the table in effects.c, at the place in the order where it acts.
 *   3. test it in tests/unit/effects/test_NAME.c, and give it a law of another engine in tests/hidden.
 * Hooks that use real_t (effects/real.h) and do not branch by a value also run for several robots side by side. Hooks
 * that use double run robot by robot, which gives the same bytes and takes longer.
 * Nothing else lists effects: the command line, the fits, discovery and the reports read the table.
 */
#ifndef BRICKPILOT_EFFECTS_EFFECT_H
#define BRICKPILOT_EFFECTS_EFFECT_H

#include "effects/vehicle.h"
#if LANES > 1
#include "effects_in_lanes.h" /* made by CMake: a list of these effects, and their names for this width */
#endif

/* Makes the effect act at one site. `value` holds the parameters in the order of the row. `memory` is the effect's own
 * state in this run, `memory_count` doubles that are 0 at the run's start. Hooks are called in the order of the table.
 * An effect that is off costs nothing. */
typedef void effect_hook_t(const real_t *value, real_t *memory, vehicle_t *vehicle);

typedef enum {
    SITE_BUILD,  /* once, before the vehicle is put into its initial state. Changes build */
    SITE_START,  /* once, before the first step */
    SITE_TIMING, /* each motor step: when a command arrives. Changes command */
    SITE_SUPPLY, /* at the start and each body step. Changes supply */
    SITE_DRIVE,  /* each motor step: command to voltage. Changes voltage; a load on the supply changes supply too */
    SITE_MOTOR,  /* each body step. Changes motor[] */
    SITE_WHEEL,  /* each motor step, for gears too. Adds to wheel_torque and dry */
    SITE_BODY,   /* each body step. Adds to force_*, moment_yaw, drag_* */
    SITE_SENSOR, /* after each body step and before the first. Changes output */
    SITE_COUNT
} site_t;

/* Adds to `undoable` what the firmware can undo of the effect with these parameters. */
typedef void effect_undo_t(const double *value, bp_undoable *undoable);

enum { EFFECT_MEMORY = 4096 }; /* doubles of memory that all active effects of a run share */

typedef struct {
    bp_effect_info info;
    int memory_count;
    effect_hook_t *hook[SITE_COUNT]; /* NULL: the effect does not act there */
    effect_undo_t *undo;             /* NULL: the firmware can undo no part of the effect */
} effect_t;

/* The row of the table at `index`, or NULL beyond the last row. */
const effect_t *effect_at(int index);

/* The index of the effect of that name, or -1. */
int effect_index(const char *name);

#endif
