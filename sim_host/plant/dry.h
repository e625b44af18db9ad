/* dry.h: dry friction of two coupled wheels, solved exactly within a motor step.
 *
 * The wheel speeds w minimise 1/2 (w - f)' A (w - f) + sum_i c_i |d_i . w|. Here f are the speeds without dry friction,
 * and d_i are the four motions of dry_t: left (1, 0), right (0, 1), surge (1, 1), yaw (1, -1). Each motion meets a
 * bounded impulse against it, or the impulse that holds it at exactly zero. The bounds of any number of effects add up
 * in c_i.
 */
#ifndef BRICKPILOT_PLANT_DRY_H
#define BRICKPILOT_PLANT_DRY_H

#include "effects/vehicle.h"

/* A symmetric 2 x 2 matrix. */
typedef struct {
    double left;  /* left, left */
    double right; /* right, right */
    double cross;
} pair_t;

/* Replaces the speeds w without dry friction by those with it. matrix is A, positive definite; inverse is that of A;
 * bound holds c_i >= 0 in N m s. */
void dry_solve(double w[2], const pair_t *matrix, const pair_t *inverse, const double bound[DRY_COUNT]);

#endif
