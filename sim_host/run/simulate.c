#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "brickpilot_sim.h"
#include "plant/lanes.h"
#include "run/thread.h"

enum { THREADS_MAX = 64 };
enum { LOOK_AHEAD = 64 }; /* a run joins a group only if it is at most this many places further on in the list */

typedef struct {
    bp_run *runs;
    int count;
    int widest;  /* largest number of runs that go side by side */
    int next;    /* all earlier runs are taken */
    bool *taken; /* `count` flags, one for each run; NULL if each run goes alone */
    lock_t lock;
} queue_t;

/* Runs that go side by side: they have the same samples, longest steps and kind of vehicle. */
typedef struct {
    bp_run *run[LANES_MOST];
    int count;
} group_t;

static void keep_outputs(const plant_t *plant, const bp_run *run, ptrdiff_t sample)
{
    double row[OUTPUT_COUNT];
    if (run->columns == NULL) {
        plant_outputs(plant, run->output + sample * OUTPUT_COUNT);
        return;
    }
    plant_outputs(plant, row);
    for (int i = 0; i < run->column_count; i++)
        run->output[(ptrdiff_t)i * run->samples + sample] = row[run->columns[i]];
}

static void input_of(const bp_run *run, int sample, double input[2])
{
    const int inputs = run->model->vehicle == BP_MOTOR ? 1 : 2;
    const double *given = run->input + (ptrdiff_t)sample * inputs;
    input[0] = given[0];
    input[1] = inputs == 2 ? given[1] : 0;
}

/* Puts a plant into the run's initial state and keeps the outputs there. */
static int start(plant_t *plant, const bp_run *run)
{
    if (run->samples < 1)
        return BP_E_TIME;
    const int status = plant_start(plant, run->model, &run->initial, run->motor_step, run->body_step);
    if (status == 0)
        keep_outputs(plant, run, 0);
    return status;
}

static int advance(plant_t *plant, const bp_run *run)
{
    int status = 0, restarts = 0;
    for (int k = 0; k + 1 < run->samples; k++) {
        if (restarts < run->restart_count && run->restart[restarts].sample == k)
            status = plant_restart(plant, &run->restart[restarts++].state);
        if (status != 0)
            return status;
        double input[2];
        input_of(run, k, input);
        status = plant_advance(plant, input, run->time[k + 1] - run->time[k]);
        if (status != 0)
            return status;
        keep_outputs(plant, run, k + 1);
    }
    return 0;
}

static void finish(bp_run *run, int status, const bp_state *last)
{
    run->final = status == 0 ? *last : run->initial;
    run->status = status;
}

static void simulate_alone(bp_run *run)
{
    plant_t plant;
    const int status = start(&plant, run);
    finish(run, status != 0 ? status : advance(&plant, run), &plant.vehicle.state);
}

static void keep_lanes(lanes_t *lanes, const group_t *group, ptrdiff_t sample)
{
    lanes_sense(lanes);
    for (int lane = 0; lane < group->count; lane++) {
        const bp_run *run = group->run[lane];
        if (lanes->status[lane] != 0)
            continue;
        if (run->columns == NULL)
            lanes_outputs(lanes, lane, NULL, OUTPUT_COUNT, run->output + sample * OUTPUT_COUNT, 1);
        else
            lanes_outputs(lanes, lane, run->columns, run->column_count, run->output + sample, run->samples);
    }
}

static void advance_lanes(lanes_t *lanes, const group_t *group)
{
    const bp_run *first = group->run[0];
    int restarts[LANES_MOST] = {0};
    lanes_open(lanes, group->count);
    for (int k = 0; k + 1 < first->samples; k++) {
        double input[LANES_MOST][2];
        for (int lane = 0; lane < group->count; lane++) {
            const bp_run *run = group->run[lane];
            if (restarts[lane] < run->restart_count && run->restart[restarts[lane]].sample == k)
                lanes_restart(lanes, lane, &run->restart[restarts[lane]++].state);
            input_of(run, k, input[lane]);
        }
        lanes_advance(lanes, input, first->time[k + 1] - first->time[k]);
        keep_lanes(lanes, group, k + 1);
    }
    for (int lane = 0; lane < group->count; lane++) {
        const bp_state last = lanes_state(lanes, lane);
        finish(group->run[lane], lanes->status[lane], &last);
    }
}

/* Starts each run. A run that fails, or that cannot go into a lane, is completed here; the others go on side by
 * side. */
static void simulate_group(lanes_t *lanes, group_t *group)
{
    int kept = 0;
    for (int i = 0; i < group->count; i++) {
        bp_run *run = group->run[i];
        plant_t *plant = &lanes->plant[kept];
        const int status = start(plant, run);
        if (status == 0 && lanes_may_hold(plant))
            group->run[kept++] = run;
        else
            finish(run, status != 0 ? status : advance(plant, run), &plant->vehicle.state);
    }
    group->count = kept;
    if (kept > 1)
        advance_lanes(lanes, group);
    else if (kept == 1)
        finish(group->run[0], advance(&lanes->plant[0], group->run[0]), &lanes->plant[0].vehicle.state);
}

static bool go_together(const bp_run *a, const bp_run *b)
{
    if (a->model->vehicle != b->model->vehicle || a->model->profile != b->model->profile || a->samples != b->samples ||
        memcmp(&a->motor_step, &b->motor_step, sizeof a->motor_step) != 0 ||
        memcmp(&a->body_step, &b->body_step, sizeof a->body_step) != 0 || a->samples < 1)
        return false;
    return a->time == b->time || memcmp(a->time, b->time, (size_t)a->samples * sizeof *a->time) == 0;
}

/* Takes the first free run, and free runs near it that can go side by side with it. Groups are formed one after the
 * other, so they do not depend on which thread takes them. */
static group_t take(queue_t *queue)
{
    group_t group = {.count = 0};
    lock_take(&queue->lock);
    while (queue->next < queue->count && queue->taken != NULL && queue->taken[queue->next])
        queue->next++;
    const int first = queue->next, end = queue->count - first < LOOK_AHEAD ? queue->count : first + LOOK_AHEAD;
    if (first < queue->count)
        group.run[group.count++] = &queue->runs[queue->next++];
    for (int i = first + 1; i < end && queue->taken != NULL && group.count < queue->widest; i++) {
        if (queue->taken[i] || !go_together(&queue->runs[first], &queue->runs[i]))
            continue;
        queue->taken[i] = true;
        group.run[group.count++] = &queue->runs[i];
    }
    lock_give(&queue->lock);
    return group;
}

static THREAD_RETURNS work(void *argument)
{
    queue_t *queue = argument;
    lanes_t *lanes = queue->taken != NULL ? malloc(sizeof *lanes) : NULL;
    for (group_t group = take(queue); group.count > 0; group = take(queue))
        if (lanes != NULL && group.count > 1)
            simulate_group(lanes, &group);
        else
            for (int i = 0; i < group.count; i++)
                simulate_alone(group.run[i]);
    free(lanes);
    return THREAD_DONE;
}

int bp_simulate_lanes(bp_run *runs, int count, int threads, int lanes)
{
    queue_t queue = {.runs = runs, .count = count, .widest = lanes_shared(count, threads, lanes), .lock = LOCK_FREE};
    if (queue.widest > 1 && count > 1)
        queue.taken = calloc((size_t)count, sizeof *queue.taken);
    thread_t helper[THREADS_MAX];
    int helpers = 0;
    const int wanted = threads < count ? threads : count;
    while (helpers < wanted - 1 && helpers < THREADS_MAX && thread_start(&helper[helpers], work, &queue) == 0)
        helpers++;
    work(&queue); /* the caller works too, so if a thread does not start, only time is lost */
    for (int i = 0; i < helpers; i++)
        thread_join(helper[i]);
    free(queue.taken);

    for (int i = 0; i < count; i++)
        if (runs[i].status != 0)
            return runs[i].status;
    return 0;
}

int bp_simulate(bp_run *runs, int count, int threads)
{
    return bp_simulate_lanes(runs, count, threads, LANES_MOST);
}

int bp_lanes(void)
{
    return lanes_widest(LANES_MOST);
}
