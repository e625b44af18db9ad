#include "avr/quadrature.h"

#include <math.h>

static double counts_at(const quadrature_track_t *track, uint32_t cycle)
{
    const double share = (double)cycle / track->cycles, seconds = track->seconds;
    const double parabola = seconds * (track->rate[0] * share + (track->rate[1] - track->rate[0]) * share * share / 2);
    const double end = seconds * (track->rate[0] + track->rate[1]) / 2;
    return track->counts[0] + parabola + (track->counts[1] - track->counts[0] - end) * share;
}

static bool is_past(const quadrature_track_t *track, uint32_t cycle, int64_t count, int step)
{
    const double counts = counts_at(track, cycle);
    return step > 0 ? floor(counts) > (double)count : floor(counts) < (double)count;
}

uint32_t quadrature_next(const quadrature_track_t *track, int64_t count, int *step)
{
    const double end = floor(track->counts[1]);
    uint32_t before = 0, past = track->cycles;

    if (end == (double)count)
        return 0;
    *step = end > (double)count ? 1 : -1;
    if (!is_past(track, past, count, *step)) /* rounding at the very end: the edge comes in the next track */
        return 0;
    while (past - before > 1) {
        const uint32_t middle = before + (past - before) / 2;
        if (is_past(track, middle, count, *step))
            past = middle;
        else
            before = middle;
    }
    return past;
}

bool quadrature_a(int64_t count)
{
    return ((count + 1) & 2) != 0; /* over four counts: 0 1 1 0 */
}

bool quadrature_b(int64_t count)
{
    return (count & 2) != 0; /* over four counts: 0 0 1 1 */
}
