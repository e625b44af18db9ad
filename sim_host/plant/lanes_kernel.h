/* lanes_kernel.h: the step of plant/step.h in vector registers, and what plant/lanes.c needs of it.
 *
 * lanes_laws.c is compiled once for each width, with the laws of effects that are written over real_t. There a
 * vehicle_t holds LANES robots, so both files share only these types. The number at index i of a plant's vehicle has
 * index i * width + lane here, and in all arrays below. */
#ifndef BRICKPILOT_PLANT_LANES_KERNEL_H
#define BRICKPILOT_PLANT_LANES_KERNEL_H

#include <stdbool.h>
#include <stddef.h>

#include "effects/effect.h"

enum { LANES_BYTES = 65536, LANES_ALIGNMENT = 64 }; /* bytes: size and alignment of a group's memory */

/* Limits for the effects of a group that run in registers: their number, and the parameters and doubles of memory of
 * each. All other effects run robot by robot. */
enum { LAWS_MOST = 16, LAW_VALUES = 8, LAW_MEMORY = 16 };

typedef struct {
    const effect_t *effect; /* only the kernel uses it */
    unsigned robots;        /* one bit for each lane that has this effect */
    double *value;          /* LAW_VALUES parameters for each lane */
    double *memory;         /* LAW_MEMORY doubles for each lane */
} lanes_law_t;

/* What happens at a site, in the order of the table of effects. */
enum { STEPS_MOST = 2 * LAWS_MOST + 1 };
typedef struct {
    int count;
    struct {
        int law;   /* an index into `law`; or -1: hooks that run robot by robot */
        int batch; /* if law is -1: number of the batch of hooks, for `run` */
    } step[STEPS_MOST];
} lanes_site_t;

/* One group of robots. */
typedef struct {
    double *vehicle;   /* all numbers of vehicle_t: see vehicle_numbers */
    double *nominal;   /* all numbers of vehicle_t.motor, without effects */
    double *parameter; /* PARAMETER_COUNT */
    double *input;     /* 2 voltages, V */
    double *output;    /* OUTPUT_COUNT */
    lanes_law_t law[LAWS_MOST];

    /* Filled by the caller: the effects, and how to run those that run robot by robot. If there are any, `tell` is
     * called before SITE_BODY, to pass on what a body step has changed, and after SITE_MOTOR. */
    lanes_site_t site[SITE_COUNT];
    void (*tell)(void *owner, site_t site);
    void (*run)(void *owner, site_t site, int batch);
    void *owner;
} lanes_view_t;

typedef struct {
    int width;
    int vehicle_numbers;     /* must be vehicle_numbers() of one robot */
    bool (*runs_here)(void); /* this processor has such registers */

    /* Makes a group in `memory`, which has LANES_BYTES and LANES_ALIGNMENT. */
    lanes_view_t *(*open)(void *memory, int vehicle, int profile);

    /* Finds the law in registers for the effect of this name; NULL: the effect runs robot by robot. */
    const effect_t *(*law)(const char *name);

    /* Advances by body_count steps of `step` s each; returns one bit for each lane whose state is finite. */
    unsigned (*advance)(void *memory, double step, int body_count, int motor_count);

    /* Fills the view's `output` anew. */
    void (*outputs)(void *memory);
} lanes_kernel_t;

extern const lanes_kernel_t lanes_kernel_2, lanes_kernel_4, lanes_kernel_8;

/* Number of the numbers at the beginning of a vehicle_t. */
static inline int vehicle_numbers(void)
{
    return (int)(offsetof(vehicle_t, parameter) / sizeof(real_t));
}

#endif
