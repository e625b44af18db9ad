/* quadrature.h: when a rotation sensor's next edge comes, and the levels of its two signals.
 *
 * Between two motor steps the plant's wheel speed changes linearly, so the angle is a parabola of time.
 */
#ifndef BRICKPILOT_SIM_AVR_QUADRATURE_H
#define BRICKPILOT_SIM_AVR_QUADRATURE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    double counts[2]; /* at the start and at the end: angle times counts per turn, not rounded */
    double rate[2];   /* counts/s */
    double seconds;   /* from start to end */
    uint32_t cycles;  /* time from start to end in cycles; 1 or more */
} quadrature_track_t;

/* Returns the cycle since the track's start, 1..track->cycles, at which the sensor's count leaves `count` and does not
 * return in this track; 0: it does not leave. `step` becomes +1 or -1. */
uint32_t quadrature_next(const quadrature_track_t *track, int64_t count, int *step);

/* The levels of A and B at a count. In forward motion A leads B. */
bool quadrature_a(int64_t count);
bool quadrature_b(int64_t count);

#endif
