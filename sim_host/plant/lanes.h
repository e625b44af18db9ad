/* lanes.h: several plants that advance together, each in a lane of the processor's vector registers. They get the same
 * bytes as alone: the laws are the same files (effects/real.h), and so are the effects that are written over real_t. The
 * hooks of the others run plant by plant.
 *
 * Plants fit together that have the same kind of vehicle, profile and longest steps, and no tyres that slip. The caller
 * starts plant[0] to plant[count - 1], calls lanes_open(), and from then on reaches them by these functions alone. */
#ifndef BRICKPILOT_PLANT_LANES_H
#define BRICKPILOT_PLANT_LANES_H

#include "plant/lanes_kernel.h"
#include "plant/plant.h"

enum { LANES_MOST = 8 };

/* Hooks of one plant at a site, from its plant_t.hook[site]. */
typedef struct {
    unsigned char first, end;
} hooks_t;

typedef struct {
    plant_t plant[LANES_MOST];
    int count;
    int status[LANES_MOST]; /* 0, or why a plant has stopped; it then stays as it is */
    int law_count;
    const effect_t *effect_of_law[LAWS_MOST];
    hooks_t batch[SITE_COUNT][LAWS_MOST + 1][LANES_MOST]; /* what runs robot by robot between two laws */
    bool acts[LANES_MOST];                                /* this plant has such hooks before its sensors */
    const lanes_kernel_t *kernel;
    lanes_view_t *view;
    unsigned char *memory;
    unsigned char space[LANES_BYTES + LANES_ALIGNMENT];
} lanes_t;

/* How many plants can be in one group on this processor: 2, 4 or 8, but at most `limit`; 1 for less than 2. */
int lanes_widest(int limit);

/* The same for `count` plants that so many threads share: no wider than leaves something to do for each thread. */
int lanes_shared(int count, int threads, int limit);

/* True where this plant can be in a group. It has been started. */
bool lanes_may_hold(const plant_t *plant);

/* Begins with plants that have been started; 2 to lanes_widest() of them. */
void lanes_open(lanes_t *lanes, int count);

/* plant_restart() and plant_advance() for plants that have not stopped. Their results are in `status`. */
void lanes_restart(lanes_t *lanes, int lane, const bp_state *state);
void lanes_advance(lanes_t *lanes, const double input[][2], double dt);

/* Computes the outputs of all plants, for lanes_outputs(). */
void lanes_sense(lanes_t *lanes);

/* Puts `count` outputs of a plant, those in `column`, or the first ones where that is NULL, into out[0], out[stride] and
 * so on. */
void lanes_outputs(const lanes_t *lanes, int lane, const int *column, int count, double *out, ptrdiff_t stride);

bp_state lanes_state(const lanes_t *lanes, int lane);

/* Brings plant[lane] up to date, for plant_outputs() and for who reads its vehicle. */
void lanes_tell(lanes_t *lanes, int lane);

#endif
