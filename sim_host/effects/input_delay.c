#include "effects/effect.h"

#include <math.h>

enum { CHANGES = 192 };

typedef struct {
    double time;
    double command[2];
} change_t;

/* A ring buffer of the changes of the command that have not arrived yet: `count` changes from index `first`. Before the
 * run the command was 0 V. */
typedef struct {
    double time, first, count;
    double arrived[2];
    change_t change[CHANGES];
} line_t;

static int differs(double a, double b)
{
    return isnan(a) != isnan(b) || a < b || a > b;
}

static change_t *waiting(line_t *line, int i)
{
    return &line->change[((int)line->first + i) % CHANGES];
}

/* Adds a change of the command. If there are more changes than the ring holds, the last two are merged. */
static void enter(line_t *line, const double command[2])
{
    const int count = (int)line->count;
    const double *last = count > 0 ? waiting(line, count - 1)->command : line->arrived;
    if (!differs(command[0], last[0]) && !differs(command[1], last[1]))
        return;
    change_t *change = waiting(line, count < CHANGES ? count : CHANGES - 1);
    if (count < CHANGES) {
        change->time = line->time;
        line->count++;
    }
    change->command[0] = command[0];
    change->command[1] = command[1];
}

/* The command of a step in which a change arrives: the weighted mean of the old and the new command. If the motor
 * floats in a part of the step, the command of the longer part. */
static double blend(double early, double late, double late_share)
{
    if (isnan(early) || isnan(late))
        return late_share > 0.5 ? late : early;
    return early + late_share * (late - early);
}

static void timing(const double *value, double *memory, vehicle_t *vehicle)
{
    line_t *line = (line_t *)memory;
    if (!(value[0] > 0))
        return;
    enter(line, vehicle->command);
    double mean[2] = {line->arrived[0], line->arrived[1]};
    while (line->count > 0) {
        const change_t *change = waiting(line, 0);
        const double share = 1 - (change->time + value[0] - line->time) / vehicle->step;
        if (share <= 0)
            break;
        for (int k = 0; k < 2; k++) {
            mean[k] = blend(mean[k], change->command[k], share < 1 ? share : 1);
            line->arrived[k] = change->command[k];
        }
        line->first = ((int)line->first + 1) % CHANGES;
        line->count--;
    }
    line->time += vehicle->step;
    vehicle->command[0] = mean[0];
    vehicle->command[1] = mean[1];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "delay",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "time from a command to its effect; until the run's first command arrives the motors get 0 V",
     .minimum = 0,
     .maximum = 0.5,
     .preset = 0.06},
};

const effect_t effect_input_delay = {
    .info = {.name = "input_delay",
             .words = "a delay from command to motor",
             .summary = "Every command reaches the motors some time after it is given.",
             .mechanism = "timing",
             .acts_on = "timing",
             .equation = "V(t) = V_command(t - delay), and 0 V before the run. A motor step takes the mean over its "
                         "length, so any delay counts. Up to 192 changes of the command may be on their way",
             .source = "dead time, Ljung 1999, System Identification",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every command waits for a bus or a control cycle before it reaches the motors.",
             .advice = "Send commands at a steady rate, and shorten what lies between them and the motors.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = sizeof(line_t) / sizeof(double),
    .hook = {[SITE_TIMING] = timing},
};
