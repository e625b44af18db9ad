/* effect.h: a named effect the nominal model lacks: a row of constants and the hooks of the sites where it acts.
 *
 * To add one: a file beside this one that defines `const effect_t effect_NAME`, a line below, a row in effects.c, and a
 * unit test. Hooks are called in the order of the table, only those that are not NULL, only of effects that are
 * switched on.
 */
#ifndef BRICKPILOT_EFFECTS_EFFECT_H
#define BRICKPILOT_EFFECTS_EFFECT_H

#include "effects/vehicle.h"

/* value: the effect's parameters, in the order of its table. memory: its own state in this run, `memory_count` doubles.
 */
typedef void effect_hook_t(const double *value, double *memory, vehicle_t *vehicle);

typedef enum {
    SITE_START,  /* once, before the first step; memory is all 0 */
    SITE_TIMING, /* each motor step: when a command arrives. Changes command */
    SITE_SUPPLY, /* each body step. Changes supply */
    SITE_DRIVE,  /* each motor step: command to voltage. Changes voltage */
    SITE_MOTOR,  /* each body step. Changes motor[] */
    SITE_WHEEL,  /* each motor step, for gears too. Adds to wheel_torque and dry */
    SITE_BODY,   /* each body step. Adds to force_*, moment_yaw, drag_* */
    SITE_SENSOR, /* after each body step and before the first. Changes output */
    SITE_COUNT
} site_t;

enum { EFFECT_MEMORY = 1024 }; /* doubles of memory, all active effects of a run together */

typedef struct {
    bp_effect_info info;
    int memory_count;
    effect_hook_t *hook[SITE_COUNT];
} effect_t;

/* Row of the table, or NULL beyond the last. */
const effect_t *effect_at(int index);

/* Index of the effect of that name, or -1. */
int effect_index(const char *name);

extern const effect_t effect_actuator_deadband;
extern const effect_t effect_coulomb_friction;

#endif
