/* lanes_kernel.h: the step of plant/step.h in vector registers, and what plant/lanes.c knows of it.
 *
 * lanes_2.c, lanes_4.c and lanes_8.c make one kernel each, for registers of 128, 256 and 512 bits: they define LANES and
 * include lanes_laws.h. There a vehicle_t holds LANES robots, so the two sides share no type but this one. A number that
 * stands at place i of a plant's vehicle stands at place i * width + lane here.
 */
#ifndef BRICKPILOT_PLANT_LANES_KERNEL_H
#define BRICKPILOT_PLANT_LANES_KERNEL_H

#include <stdbool.h>
#include <stddef.h>

#include "effects/effect.h"

enum { LANES_BYTES = 32768, LANES_ALIGNMENT = 64 }; /* of the memory of a group */

/* One group of robots. Its arrays are `width` times as long as for one robot. */
typedef struct {
    double *vehicle;   /* all numbers of vehicle_t: see vehicle_numbers */
    double *parameter; /* PARAMETER_COUNT */
    double *input;     /* 2, V */
    double *output;    /* OUTPUT_COUNT */

    /* Filled by the caller: the sites at which a robot has effects, and how to run them. SITE_BODY comes first in each
     * body step, and SITE_MOTOR sets the nominal motors anew before. */
    bool acts[SITE_COUNT];
    void (*run)(void *owner, site_t site);
    void *owner;
} lanes_view_t;

typedef struct {
    int width;
    int vehicle_numbers;     /* must be vehicle_numbers() of one robot */
    bool (*runs_here)(void); /* this processor has such registers */

    /* Makes a group in `memory`, which has LANES_BYTES and that alignment. */
    lanes_view_t *(*open)(void *memory, int vehicle, int profile);

    /* Advances by body_count steps of `step` s each; returns one bit for each lane whose state is finite. */
    unsigned (*advance)(void *memory, double step, int body_count, int motor_count);

    /* Fills the view's `output`, without sensor effects. */
    void (*outputs)(void *memory);
} lanes_kernel_t;

extern const lanes_kernel_t lanes_kernel_2, lanes_kernel_4, lanes_kernel_8;

/* How many numbers a vehicle_t begins with. */
static inline int vehicle_numbers(void)
{
    return (int)(offsetof(vehicle_t, parameter) / sizeof(real_t));
}

#endif
