/* dry.h: dry friction of two coupled wheels, solved exactly within a motor step.
 *
 * Wheel speeds w minimise 1/2 (w - f)' A (w - f) + sum_i c_i |d_i . w|, f being the speeds without dry friction and d_i
 * the four motions of dry_t: left (1, 0), right (0, 1), surge (1, 1), yaw (1, -1). That is a bounded impulse against
 * each motion, or the impulse that holds it at exactly zero. Any number of effects add up in c_i.
 */
#ifndef BRICKPILOT_PLANT_DRY_H
#define BRICKPILOT_PLANT_DRY_H

#include "effects/vehicle.h"

/* Symmetric 2 x 2 matrix. */
typedef struct {
    double left;  /* left, left */
    double right; /* right, right */
    double cross;
} pair_t;

/* Replaces the free speeds w by those with dry friction. matrix: A, positive definite; inverse: of A; bound: c_i >= 0,
 * N m s. */
void dry_solve(double w[2], const pair_t *matrix, const pair_t *inverse, const double bound[DRY_COUNT]);

#endif
