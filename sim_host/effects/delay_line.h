/* delay_line.h: the memory of sensor effects that show past readings. */
#ifndef BRICKPILOT_EFFECTS_DELAY_LINE_H
#define BRICKPILOT_EFFECTS_DELAY_LINE_H

#include <stdbool.h>
#include <string.h>

#include "effects/effect.h"

enum { DELAY_ROWS = 128 };

/* A ring buffer of rows. `oldest` is the last row at or before the time that is read, `newest` is the present row. */
typedef struct {
    double started, time, oldest, newest;
    double stamp[DELAY_ROWS]; /* s: the time of a row */
    double signal[];          /* `count` readings a row */
} delay_line_t;

/* Number of doubles in the memory of an effect that delays `count` signals. */
#define DELAY_MEMORY(count) ((int)(sizeof(delay_line_t) / sizeof(double)) + DELAY_ROWS * (count))

static inline int delay_after(int row)
{
    return (row + 1) % DELAY_ROWS;
}

/* Rows must be so far apart that the ring spans the delay: the newest row is overwritten until it is far enough from
 * the previous row. */
static inline void delay_remember(delay_line_t *line, const double *signal, int count, double delay)
{
    const int newest = (int)line->newest, before = (newest + DELAY_ROWS - 1) % DELAY_ROWS;
    const double spacing = delay / (DELAY_ROWS - 3);
    const bool far = newest == (int)line->oldest || line->stamp[newest] - line->stamp[before] >= spacing;
    const int row = line->started == 0 || !far ? newest : delay_after(newest);
    line->started = 1;
    line->newest = row;
    line->stamp[row] = line->time;
    memcpy(&line->signal[row * count], signal, (size_t)count * sizeof *signal);
}

/* Reads the ring at `time`: linear between rows; before the run, the first row. */
static inline void delay_recall(delay_line_t *line, double *signal, int count, double time)
{
    int oldest = (int)line->oldest;
    while (oldest != (int)line->newest && line->stamp[delay_after(oldest)] <= time)
        oldest = delay_after(oldest);
    line->oldest = oldest;
    const int next = delay_after(oldest);
    const double *from = &line->signal[oldest * count], *to = &line->signal[next * count];
    const bool between = oldest != (int)line->newest;
    const double share = between ? (time - line->stamp[oldest]) / (line->stamp[next] - line->stamp[oldest]) : 0;
    for (int i = 0; i < count; i++)
        signal[i] = share > 0 ? from[i] + share * (to[i] - from[i]) : from[i];
}

/* Replaces `count` readings after a step of `step` s by the readings `delay` s earlier. */
static inline void delay_signals(double *memory, double *signal, int count, double delay, double step)
{
    delay_line_t *line = (delay_line_t *)memory;
    line->time += step;
    delay_remember(line, signal, count, delay);
    delay_recall(line, signal, count, line->time - delay);
}

#endif
