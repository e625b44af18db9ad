#include <math.h>
#include <stddef.h>

#include "brickpilot_sim.h"
#include "plant/plant.h"
#include "run/thread.h"

enum { THREADS_MAX = 64 };

typedef struct {
    bp_run *runs;
    int count;
    int next;
    lock_t lock;
} queue_t;

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

static int simulate(plant_t *plant, const bp_run *run)
{
    const int inputs = run->model->vehicle == BP_MOTOR ? 1 : 2;
    if (run->samples < 1)
        return BP_E_TIME;
    int status = plant_start(plant, run->model, &run->initial, run->motor_step, run->body_step);
    if (status != 0)
        return status;
    keep_outputs(plant, run, 0);
    int restarts = 0;
    for (int k = 0; k + 1 < run->samples; k++) {
        if (restarts < run->restart_count && run->restart[restarts].sample == k)
            status = plant_restart(plant, &run->restart[restarts++].state);
        if (status != 0)
            return status;
        const double *given = run->input + (ptrdiff_t)k * inputs;
        const double input[2] = {given[0], inputs == 2 ? given[1] : 0};
        status = plant_advance(plant, input, run->time[k + 1] - run->time[k]);
        if (status != 0)
            return status;
        keep_outputs(plant, run, k + 1);
    }
    return 0;
}

static void simulate_run(bp_run *run)
{
    plant_t plant;
    run->status = simulate(&plant, run);
    run->final = run->status == 0 ? plant.vehicle.state : run->initial;
}

static THREAD_RETURNS work(void *argument)
{
    queue_t *queue = argument;
    for (;;) {
        lock_take(&queue->lock);
        const int mine = queue->next < queue->count ? queue->next++ : -1;
        lock_give(&queue->lock);
        if (mine < 0)
            return THREAD_DONE;
        simulate_run(&queue->runs[mine]);
    }
}

int bp_simulate(bp_run *runs, int count, int threads)
{
    queue_t queue = {.runs = runs, .count = count, .lock = LOCK_FREE};
    thread_t helper[THREADS_MAX];
    int helpers = 0;
    const int wanted = threads < count ? threads : count;
    while (helpers < wanted - 1 && helpers < THREADS_MAX && thread_start(&helper[helpers], work, &queue) == 0)
        helpers++;
    work(&queue); /* the caller works too, so a thread that fails to start costs time only */
    for (int i = 0; i < helpers; i++)
        thread_join(helper[i]);

    for (int i = 0; i < count; i++)
        if (runs[i].status != 0)
            return runs[i].status;
    return 0;
}
