/* double_paper_body.h: the paper's vehicle, eq. 2 to 17, in double precision, stepped by the rule of model/body.h.
 *
 * The direction of thrust is taken once per step of 3 ms, at its beginning; the host plant takes it twice (Heun). Where
 * firmware and this agree and the plant does not, the rule makes the difference, not the fixed point.
 */
#ifndef BRICKPILOT_TESTS_DOUBLE_PAPER_BODY_H
#define BRICKPILOT_TESTS_DOUBLE_PAPER_BODY_H

#include "brickpilot_sim.h"

/* In `state`, all zero or with a pose to begin with; SI units. */
typedef struct {
    bp_state state;
    double velocity[2]; /* m/s, along the axes of the room */
} double_paper_body_t;

/* One step of 3 ms with both voltages (left, right; V) held. */
void double_paper_body_step(double_paper_body_t *body, const double voltage[2]);

#endif
