/* lanes.h: several plants that advance together, each in a lane of the processor's vector registers. Each gives the
 * same bytes as alone: its laws, and the effects that are written over real_t (effects/real.h), come from the same
 * files. The hooks of other effects run plant by plant.
 *
 * Plants can form a group if they have the same kind of vehicle, profile and longest steps, and no tyres that slip. The
 * caller starts plant[0] to plant[count - 1], calls lanes_open(), and then uses only these functions for the plants. */
#ifndef BRICKPILOT_PLANT_LANES_H
#define BRICKPILOT_PLANT_LANES_H

#include "plant/lanes_kernel.h"
#include "plant/plant.h"

enum { LANES_MOST = 8 };

/* Hooks of one plant at a site: first..end - 1 of its plant_t.hook[site]. */
typedef struct {
    unsigned char first, end;
} hooks_t;

typedef struct {
    plant_t plant[LANES_MOST];
    int count;
    int status[LANES_MOST]; /* 0, or the error that has stopped a plant; the plant then no longer changes */
    int law_count;
    const effect_t *effect_of_law[LAWS_MOST];
    hooks_t batch[SITE_COUNT][LAWS_MOST + 1][LANES_MOST]; /* hooks that run robot by robot between two laws */
    bool acts[LANES_MOST];                                /* this plant has hooks in batch before SITE_SENSOR */
    const lanes_kernel_t *kernel;
    lanes_view_t *view;
    unsigned char *memory;
    unsigned char space[LANES_BYTES + LANES_ALIGNMENT];
} lanes_t;

/* How many plants can be in one group on this processor: 2, 4 or 8, but at most `limit`; 1: a group is not possible. */
int lanes_widest(int limit);

/* As lanes_widest(), for `count` plants that `threads` threads share: small enough that each thread gets a group. */
int lanes_shared(int count, int threads, int limit);

/* True if this plant, which has been started, can be in a group. */
bool lanes_may_hold(const plant_t *plant);

/* Makes a group of `count` started plants, 2 to lanes_widest(). */
void lanes_open(lanes_t *lanes, int count);

/* plant_restart() and plant_advance() for plants that have not stopped. Their results are in `status`. */
void lanes_restart(lanes_t *lanes, int lane, const bp_state *state);
void lanes_advance(lanes_t *lanes, const double input[][2], double dt);

/* Computes the outputs of all plants, for lanes_outputs(). */
void lanes_sense(lanes_t *lanes);

/* Writes `count` outputs of a plant to out[0], out[stride] and so on: those in `column`, or the first ones if it is
 * NULL. */
void lanes_outputs(const lanes_t *lanes, int lane, const int *column, int count, double *out, ptrdiff_t stride);

bp_state lanes_state(const lanes_t *lanes, int lane);

/* Brings plant[lane] up to date, for plant_outputs() and for readers of its vehicle. */
void lanes_tell(lanes_t *lanes, int lane);

#endif
