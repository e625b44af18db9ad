#include <stddef.h>
#include <stdlib.h>

#include "run/predictor.h"

/* Doubles of a sample: slope, mean and covariance. */
static ptrdiff_t each(const trace_t *trace)
{
    return (ptrdiff_t)trace->states * (trace->rows + 1 + trace->states);
}

bool trace_open(trace_t *trace, const predictor_t *predictor)
{
    const size_t samples = (size_t)predictor->given->run.samples;
    trace->states = predictor->layout.states;
    trace->rows = predictor->kalman.rows;
    trace->outputs = predictor->given->measured_count;
    trace->values = malloc(samples * (size_t)each(trace) * sizeof *trace->values);
    trace->updates = malloc(samples * (size_t)trace->outputs * sizeof *trace->updates);
    return trace->values != NULL && trace->updates != NULL;
}

void trace_close(trace_t *trace)
{
    free(trace->values);
    free(trace->updates);
}

double *trace_slope(const trace_t *trace, int k)
{
    return trace->values + k * each(trace);
}

double *trace_mean(const trace_t *trace, int k)
{
    return trace_slope(trace, k) + (ptrdiff_t)trace->states * trace->rows;
}

double *trace_cov(const trace_t *trace, int k)
{
    return trace_mean(trace, k) + trace->states;
}

kalman_update_t *trace_updates(const trace_t *trace, int k)
{
    return trace->updates + (ptrdiff_t)k * trace->outputs;
}
