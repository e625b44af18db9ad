#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "run/predictor.h"

static const double TWO_PI = 6.283185307179586;

static int count_rows(const bp_prediction *given, int samples)
{
    return samples * given->measured_count;
}

static void fill(double *values, int count, double value)
{
    for (int i = 0; values != NULL && i < count; i++)
        values[i] = value;
}

static bool in_range(const bp_prediction *given)
{
    if (given->measured_count < 1 || given->measured_count > BP_MAX_MEASURED || !(given->decay >= 0) ||
        !(given->drift_decay >= 0) || !(given->horizon >= 0))
        return false;
    bool good = true;
    for (int i = 0; i < given->measured_count; i++) {
        const int output = given->measured_output[i];
        good = good && output >= 0 && output < OUTPUT_COUNT && given->noise[i] > 0 && isfinite(given->noise[i]) &&
               given->drift[i] >= 0 && isfinite(given->drift[i]);
    }
    for (int i = 0; i < BP_LOADS; i++)
        good = good && given->white[i] >= 0 && isfinite(given->white[i]) && given->walk[i] >= 0 &&
               isfinite(given->walk[i]);
    for (int i = 0; i < BP_ESTIMATES - BP_LOADS; i++)
        good = good && given->start_sd[i] >= 0 && isfinite(given->start_sd[i]);
    return good;
}

/* Updates the estimate at sample k with each reading. */
static void update(predictor_t *p, int k, kalman_update_t *updates)
{
    bp_prediction *given = p->given;
    for (int i = 0; i < given->measured_count; i++) {
        const ptrdiff_t cell = (ptrdiff_t)k * given->measured_count + i;
        const double reading = given->measured[cell];
        updates[i].innovation = NAN;
        if (isnan(reading))
            continue;
        kalman_update(&p->kalman, p->layout.states + i, reading, given->noise[i] * given->noise[i], &updates[i]);
        const double e = updates[i].innovation, variance = updates[i].variance;
        given->log_likelihood -= 0.5 * (log(TWO_PI * variance) + e * e / variance);
        given->innovation_count++;
        if (given->innovation != NULL)
            given->innovation[cell] = e;
        if (given->innovation_variance != NULL)
            given->innovation_variance[cell] = variance;
    }
}

static void keep(const predictor_t *p, int k, trace_t *trace)
{
    const int states = p->layout.states;
    for (int i = 0; i < states; i++)
        memcpy(trace_cov(trace, k) + (ptrdiff_t)i * states, &p->kalman.cov[i * p->kalman.rows],
               (size_t)states * sizeof(double));
    memcpy(trace_mean(trace, k), p->kalman.mean, (size_t)states * sizeof(double));
}

/* The free run that starts again every `horizon` seconds. */
static int go_ahead(predictor_t *p, int k, const double input[2], double dt, int *window)
{
    const bp_run *run = &p->given->run;
    if (run->output == NULL)
        return 0;
    const int now = p->given->horizon > 0 ? (int)((run->time[k] - run->time[0]) / p->given->horizon + 1e-9) : 0;
    if (now != *window) {
        const double none[PUSH_COUNT] = {0};
        plant_copy(&p->ahead, &p->mean);
        plant_push(&p->ahead, none);
        *window = now;
    }
    const int status = plant_advance(&p->ahead, input, dt);
    plant_outputs(&p->ahead, run->output + (ptrdiff_t)(k + 1) * OUTPUT_COUNT);
    return status;
}

static int forwards(predictor_t *p, trace_t *trace)
{
    bp_prediction *given = p->given;
    const bp_run *run = &given->run;
    kalman_update_t unkept[BP_MAX_MEASURED];
    double slope_unkept[KALMAN_ROWS * KALMAN_STATES];
    int window = 0;
    if (run->output != NULL)
        plant_outputs(&p->ahead, run->output);
    predictor_report(p, 0, given->filtered);
    predictor_report(p, 0, given->smoothed);
    if (trace != NULL)
        keep(p, 0, trace);
    for (int k = 0; k + 1 < run->samples; k++) {
        double *slope = trace != NULL ? trace_slope(trace, k + 1) : slope_unkept;
        kalman_update_t *updates = trace != NULL ? trace_updates(trace, k + 1) : unkept;
        const double dt = run->time[k + 1] - run->time[k];
        double input[2];
        predictor_input(p, k, input);
        int status = go_ahead(p, k, input, dt, &window);
        if (status == 0)
            status = predictor_step(p, input, dt, slope);
        if (status != 0)
            return status;
        update(p, k + 1, updates);
        predictor_take_over(p);
        predictor_report(p, k + 1, given->filtered);
        predictor_report(p, k + 1, given->smoothed);
        if (trace != NULL)
            keep(p, k + 1, trace);
    }
    return isfinite(given->log_likelihood) ? 0 : BP_E_DIVERGED;
}

static void add_slopes(predictor_t *p, const kalman_back_t *back, const double *slope, double dt)
{
    bp_prediction *given = p->given;
    double driver[KALMAN_ROWS];
    for (int i = 0; i < p->layout.loads; i++) {
        const int load = p->layout.load[i];
        predictor_white_driver(p, i, slope, driver);
        given->white_slope[load] += kalman_back_driver(back, driver) / dt;
        predictor_walk_driver(p, i, driver);
        given->walk_slope[load] += kalman_back_driver(back, driver) * walk_variance(given->decay, dt);
    }
    for (int i = 0; i < p->layout.drifts; i++) {
        predictor_drift_driver(p, i, driver);
        given->drift_slope[p->layout.drift[i]] +=
            kalman_back_driver(back, driver) * walk_variance(given->drift_decay, dt);
    }
}

/* What the variances of d and b at the start say about their noise. */
static void add_start_slopes(predictor_t *p, const kalman_back_t *back)
{
    const layout_t *layout = &p->layout;
    for (int i = 0; i < layout->loads + layout->drifts; i++) {
        const bool is_load = i < layout->loads;
        const int row = layout->plant_states + i;
        const double own = back->r[row] * back->r[row] - back->n[row * layout->states + row];
        const double decay = is_load ? p->given->decay : p->given->drift_decay;
        double *slope =
            is_load ? &p->given->walk_slope[layout->load[i]] : &p->given->drift_slope[layout->drift[i - layout->loads]];
        *slope += 0.5 * own * 0.5 * decay;
    }
}

static void backwards(predictor_t *p, trace_t *trace)
{
    bp_prediction *given = p->given;
    const bp_run *run = &given->run;
    const layout_t *layout = &p->layout;
    kalman_back_t back;
    double smoothed[KALMAN_STATES], variance[KALMAN_STATES];
    kalman_back_begin(&back, layout->states, p->kalman.rows);
    for (int k = run->samples - 1; k >= 0; k--) {
        kalman_smooth(&back, trace_mean(trace, k), trace_cov(trace, k), smoothed, variance);
        predictor_report_smoothed(p, k, smoothed, variance);
        if (k == 0)
            break;
        kalman_back_open(&back);
        for (int i = given->measured_count - 1; i >= 0; i--)
            if (!isnan(trace_updates(trace, k)[i].innovation))
                given->noise_slope[i] += kalman_back_update(&back, layout->states + i, &trace_updates(trace, k)[i]);
        add_slopes(p, &back, trace_slope(trace, k), run->time[k] - run->time[k - 1]);
        kalman_back_predict(&back, trace_slope(trace, k));
    }
    add_start_slopes(p, &back);
}

static int predict(bp_prediction *given)
{
    if (given->run.samples < 1)
        return BP_E_TIME;
    if (!in_range(given))
        return BP_E_RANGE;
    predictor_t *p = predictor_new(given);
    if (p == NULL)
        return BP_E_MEMORY;
    trace_t trace;
    int status = predictor_start(p);
    if (status == 0 && given->smoothed == NULL)
        status = forwards(p, NULL);
    else if (status == 0) {
        status = trace_open(&trace, p) ? forwards(p, &trace) : BP_E_MEMORY;
        if (status == 0)
            backwards(p, &trace);
        trace_close(&trace);
    }
    predictor_free(p);
    return status;
}

int bp_predict(bp_prediction *given)
{
    given->log_likelihood = 0;
    given->innovation_count = 0;
    memset(given->noise_slope, 0, sizeof given->noise_slope);
    memset(given->drift_slope, 0, sizeof given->drift_slope);
    memset(given->white_slope, 0, sizeof given->white_slope);
    memset(given->walk_slope, 0, sizeof given->walk_slope);
    fill(given->innovation, count_rows(given, given->run.samples), NAN);
    fill(given->innovation_variance, count_rows(given, given->run.samples), NAN);
    fill(given->smoothed_sd, given->run.samples * BP_ESTIMATES, 0);
    fill(given->smoothed_drift, count_rows(given, given->run.samples), 0);
    given->status = predict(given);
    return given->status;
}
