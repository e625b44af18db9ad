/* predictor.h: the plant and its copies as the prediction of a Kalman filter. brickpilot_sim.h has the equations. */
#ifndef BRICKPILOT_RUN_PREDICTOR_H
#define BRICKPILOT_RUN_PREDICTOR_H

#include <stdbool.h>

#include "brickpilot_sim.h"
#include "plant/plant.h"
#include "run/kalman.h"

enum { TRACKED = BP_ESTIMATES - BP_LOADS }; /* fields of bp_state that an estimate may hold */

/* The states of the estimate: first fields of bp_state, then loads, then drifts. */
typedef struct {
    int states, plant_states, loads, drifts;
    int field[TRACKED];
    int load[BP_LOADS];
    int drift[BP_MAX_MEASURED];
} layout_t;

typedef struct {
    bp_prediction *given;
    layout_t layout;
    kalman_t kalman;
    double floor[KALMAN_STATES]; /* least step of a finite difference */
    double drift[BP_MAX_MEASURED];
    plant_t mean, ahead;
    plant_t copy[]; /* one for each plant state and load */
} predictor_t;

/* NULL: out of memory. */
predictor_t *predictor_new(bp_prediction *given);
void predictor_free(predictor_t *predictor);

/* Puts the plants and the estimate into the initial state. */
int predictor_start(predictor_t *predictor);

void predictor_input(const predictor_t *predictor, int k, double input[2]);

/* Advances by dt: fills the slope, rows x states, and the estimate of all rows. The slopes are differences between
 * copies of the plant, one sd of each state apart. So a wheel that friction holds is seen to let go where the estimate
 * allows for it. */
int predictor_step(predictor_t *predictor, const double input[2], double dt, double *slope);

/* Puts the plant into the updated estimate. */
void predictor_take_over(predictor_t *predictor);

/* The vectors of the drivers of load i or drift i, in rows. */
void predictor_white_driver(const predictor_t *predictor, int i, const double *slope, double *driver);
void predictor_walk_driver(const predictor_t *predictor, int i, double *driver);
void predictor_drift_driver(const predictor_t *predictor, int i, double *driver);

/* Variance that a noise of unit size adds to a state over dt, while that decays. */
double walk_variance(double decay, double dt);

/* Writes a row of BP_ESTIMATES; nothing where `rows` is NULL. */
void predictor_report(const predictor_t *predictor, int k, double *rows);
void predictor_report_smoothed(const predictor_t *predictor, int k, const double *smoothed, const double *variance);

/* What the way back needs of every sample. */
typedef struct {
    int states, rows, outputs;
    double *values;
    kalman_update_t *updates;
} trace_t;

bool trace_open(trace_t *trace, const predictor_t *predictor); /* false: out of memory */
void trace_close(trace_t *trace);
double *trace_slope(const trace_t *trace, int k);
double *trace_mean(const trace_t *trace, int k);
double *trace_cov(const trace_t *trace, int k);
kalman_update_t *trace_updates(const trace_t *trace, int k);

#endif
