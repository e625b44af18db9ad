/* kalman.h: one Gaussian estimate, its prediction and its updates, and the way back that smooths it.
 *
 * A step predicts the next state and, as further rows below it, what the sensors will read there:
 *   row = A x + sum of the drivers' vectors B, each times its own white noise of variance q
 * Readings then update the rows one by one, and the state is what stands in the first rows. So a sensor may read
 * whatever the step makes of the state before it, such as an acceleration.
 *
 * The way back is that of de Jong 1989 (also Bryson & Frazier 1963): r and N gather what later readings say, and give
 * the smoothed state x + P r with the covariance P - P N P, the same as the recursion of Rauch, Tung & Striebel. They
 * also give the slope of the log likelihood along each variance (Koopman & Shephard 1992).
 */
#ifndef BRICKPILOT_RUN_KALMAN_H
#define BRICKPILOT_RUN_KALMAN_H

enum { KALMAN_STATES = 26, KALMAN_OUTPUTS = 12, KALMAN_ROWS = KALMAN_STATES + KALMAN_OUTPUTS };

typedef struct {
    int states, rows;
    double mean[KALMAN_ROWS];
    double cov[KALMAN_ROWS * KALMAN_ROWS]; /* element (i, j) at i * rows + j */
} kalman_t;

/* What one update did; `slope` of the way back needs it. */
typedef struct {
    double innovation; /* NaN: nothing was measured */
    double variance;
    double gain[KALMAN_ROWS];
} kalman_update_t;

/* The way back: r and N of the rows. */
typedef struct {
    int states, rows;
    double r[KALMAN_ROWS];
    double n[KALMAN_ROWS * KALMAN_ROWS];
} kalman_back_t;

/* Replaces the covariance of the state by that of all rows: A P A'. `slope` is A, rows x states. The caller sets the
 * mean. */
void kalman_predict(kalman_t *kalman, const double *slope);

/* Adds a driver of this variance: cov += variance B B', B of `rows` values. */
void kalman_drive(kalman_t *kalman, const double *driver, double variance);

/* Updates all rows with a reading of row `row` and its noise variance. */
void kalman_update(kalman_t *kalman, int row, double reading, double noise, kalman_update_t *update);

/* The same steps backwards: begin at the last sample, undo its updates in reverse order, read off what is wanted, and go
 * through its prediction to the sample before. */
void kalman_back_begin(kalman_back_t *back, int states, int rows);
void kalman_back_open(kalman_back_t *back); /* from the state at a sample to its rows */
/* Returns the slope of the log likelihood along the variance of this reading's noise. */
double kalman_back_update(kalman_back_t *back, int row, const kalman_update_t *update);
/* Returns the slope of the log likelihood along the variance of the driver B. */
double kalman_back_driver(const kalman_back_t *back, const double *driver);
void kalman_back_predict(kalman_back_t *back, const double *slope);

/* Smooths the estimate of a sample after kalman_back_predict() of the next one: `mean` (states) and `cov` (states x
 * states) are the filtered ones. Fills `smoothed` and `variance`, states long each. */
void kalman_smooth(const kalman_back_t *back, const double *mean, const double *cov, double *smoothed,
                   double *variance);

#endif
