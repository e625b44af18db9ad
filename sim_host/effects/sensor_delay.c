#include "effects/effect.h"

#include <stdbool.h>
#include <string.h>

/* Room for the signals of a robot. A motor has fewer. */
enum { SIGNALS = OUTPUT_BATTERY_VOLTAGE + 1, ROWS = 128 };

typedef struct {
    double time;
    double signal[SIGNALS];
} row_t;

/* A ring of rows. `oldest` is the last row at or before the time that is read, `newest` is the present. */
typedef struct {
    double started, time, oldest, newest;
    row_t row[ROWS];
} history_t;

static int after(int row)
{
    return (row + 1) % ROWS;
}

/* Rows are so far apart that the ring spans the delay: the newest row is overwritten until it is far enough from the
 * one before it. */
static void remember(history_t *history, const double *signal, int count, double delay)
{
    const int newest = (int)history->newest, before = (newest + ROWS - 1) % ROWS;
    const double spacing = delay / (ROWS - 3);
    const bool far = newest == (int)history->oldest || history->row[newest].time - history->row[before].time >= spacing;
    row_t *row = &history->row[history->started == 0 || !far ? newest : after(newest)];
    history->started = 1;
    history->newest = (double)(row - history->row);
    row->time = history->time;
    memcpy(row->signal, signal, (size_t)count * sizeof *signal);
}

/* Reads the ring at `time`: linear between rows, and the first row before the run. */
static void recall(history_t *history, double *signal, int count, double time)
{
    int oldest = (int)history->oldest;
    while (oldest != (int)history->newest && history->row[after(oldest)].time <= time)
        oldest = after(oldest);
    history->oldest = oldest;
    const row_t *from = &history->row[oldest], *to = &history->row[after(oldest)];
    const bool between = oldest != (int)history->newest;
    const double share = between ? (time - from->time) / (to->time - from->time) : 0;
    for (int i = 0; i < count; i++)
        signal[i] = share > 0 ? from->signal[i] + share * (to->signal[i] - from->signal[i]) : from->signal[i];
}

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    history_t *history = (history_t *)memory;
    const bool motor = vehicle->vehicle == BP_MOTOR;
    double *signal = motor ? &vehicle->output[OUTPUT_BATTERY_VOLTAGE] : vehicle->output;
    const int count = motor ? OUTPUT_FORCE - OUTPUT_BATTERY_VOLTAGE + 1 : SIGNALS;
    history->time += vehicle->step;
    remember(history, signal, count, value[0]);
    recall(history, signal, count, history->time - value[0]);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "delay",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "delay of every measured signal; until it is over the run's first values hold",
     .minimum = 0,
     .maximum = 0.3,
     .preset = 0.05},
};

const effect_t effect_sensor_delay = {
    .info = {.name = "sensor_delay",
             .words = "a delay of the sensors",
             .summary = "Every sensor shows what was true some time ago.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "y(t) = x(t - delay), linear between body steps",
             .source = "dead time, Ljung 1999, System identification",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(history_t) / sizeof(double),
    .hook = {[SITE_SENSOR] = sensor},
};
