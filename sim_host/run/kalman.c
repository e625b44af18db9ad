#include "run/kalman.h"

#include <math.h>
#include <string.h>

/* out (rows x columns) = slope (rows x states) in (states x columns). Most slopes are 0: a disturbance follows itself
 * alone. */
static void multiply(double *out, const double *slope, const double *in, int rows, int states, int columns)
{
    memset(out, 0, (size_t)rows * (size_t)columns * sizeof *out);
    for (int i = 0; i < rows; i++)
        for (int k = 0; k < states; k++) {
            const double factor = slope[i * states + k];
            if (factor == 0)
                continue;
            for (int j = 0; j < columns; j++)
                out[i * columns + j] += factor * in[k * columns + j];
        }
}

static void transpose(double *out, const double *in, int rows, int columns)
{
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < columns; j++)
            out[j * rows + i] = in[i * columns + j];
}

void kalman_predict(kalman_t *kalman, const double *slope)
{
    const int rows = kalman->rows, states = kalman->states;
    double state_cov[KALMAN_STATES * KALMAN_STATES], half[KALMAN_ROWS * KALMAN_STATES];
    double turned[KALMAN_STATES * KALMAN_ROWS];
    for (int i = 0; i < states; i++)
        memcpy(&state_cov[i * states], &kalman->cov[i * rows], (size_t)states * sizeof *state_cov);
    multiply(half, slope, state_cov, rows, states, states);
    transpose(turned, half, rows, states);
    multiply(kalman->cov, slope, turned, rows, states, rows);
}

void kalman_drive(kalman_t *kalman, const double *driver, double variance)
{
    const int rows = kalman->rows;
    for (int i = 0; i < rows; i++) {
        if (driver[i] == 0)
            continue;
        for (int j = 0; j < rows; j++)
            kalman->cov[i * rows + j] += variance * driver[i] * driver[j];
    }
}

void kalman_update(kalman_t *kalman, int row, double reading, double noise, kalman_update_t *update)
{
    const int rows = kalman->rows;
    update->innovation = reading - kalman->mean[row];
    update->variance = kalman->cov[row * rows + row] + noise;
    for (int i = 0; i < rows; i++)
        update->gain[i] = kalman->cov[i * rows + row] / update->variance;
    for (int i = 0; i < rows; i++) {
        kalman->mean[i] += update->gain[i] * update->innovation;
        const double scaled = update->gain[i] * update->variance;
        for (int j = 0; j < rows; j++)
            kalman->cov[i * rows + j] -= scaled * update->gain[j];
    }
}

void kalman_back_begin(kalman_back_t *back, int states, int rows)
{
    memset(back, 0, sizeof *back);
    back->states = states;
    back->rows = rows;
}

void kalman_back_open(kalman_back_t *back)
{
    const int states = back->states, rows = back->rows;
    double n[KALMAN_STATES * KALMAN_STATES];
    memcpy(n, back->n, (size_t)(states * states) * sizeof *n);
    memset(back->n, 0, (size_t)(rows * rows) * sizeof *n);
    for (int i = 0; i < states; i++)
        memcpy(&back->n[i * rows], &n[i * states], (size_t)states * sizeof *n);
    for (int i = states; i < rows; i++)
        back->r[i] = 0;
}

/* With L = I - K h', where h picks the row: r <- h e / S + L' r, N <- h h' / S + L' N L. */
double kalman_back_update(kalman_back_t *back, int row, const kalman_update_t *update)
{
    const int rows = back->rows;
    double turned[KALMAN_ROWS]; /* N K */
    double along = 0, spread = 0;
    for (int i = 0; i < rows; i++) {
        double sum = 0;
        for (int j = 0; j < rows; j++)
            sum += back->n[i * rows + j] * update->gain[j];
        turned[i] = sum;
        along += update->gain[i] * back->r[i];
        spread += update->gain[i] * sum;
    }
    const double error = update->innovation / update->variance - along;
    const double inverse = 1 / update->variance + spread;
    back->r[row] += error;
    for (int i = 0; i < rows; i++) {
        back->n[i * rows + row] -= turned[i];
        back->n[row * rows + i] -= turned[i];
    }
    back->n[row * rows + row] += inverse;
    return 0.5 * (error * error - inverse);
}

double kalman_back_driver(const kalman_back_t *back, const double *driver)
{
    const int rows = back->rows;
    double along = 0, spread = 0;
    for (int i = 0; i < rows; i++) {
        if (driver[i] == 0)
            continue;
        along += driver[i] * back->r[i];
        for (int j = 0; j < rows; j++)
            spread += driver[i] * driver[j] * back->n[i * rows + j];
    }
    return 0.5 * (along * along - spread);
}

/* r <- A' r, N <- A' N A: from the rows to the state before the step. */
void kalman_back_predict(kalman_back_t *back, const double *slope)
{
    const int rows = back->rows, states = back->states;
    double turned_slope[KALMAN_STATES * KALMAN_ROWS], half[KALMAN_STATES * KALMAN_ROWS];
    double turned_half[KALMAN_ROWS * KALMAN_STATES], r[KALMAN_STATES];
    transpose(turned_slope, slope, rows, states);
    multiply(r, turned_slope, back->r, states, rows, 1);
    multiply(half, turned_slope, back->n, states, rows, rows);
    transpose(turned_half, half, states, rows);
    multiply(back->n, turned_slope, turned_half, states, rows, states);
    memcpy(back->r, r, (size_t)states * sizeof *r);
}

void kalman_smooth(const kalman_back_t *back, const double *mean, const double *cov, double *smoothed, double *variance)
{
    const int states = back->states;
    double half[KALMAN_STATES * KALMAN_STATES]; /* N P */
    multiply(half, back->n, cov, states, states, states);
    for (int i = 0; i < states; i++) {
        double moved = 0, known = 0;
        for (int j = 0; j < states; j++) {
            moved += cov[i * states + j] * back->r[j];
            known += cov[i * states + j] * half[j * states + i];
        }
        smoothed[i] = mean[i] + moved;
        variance[i] = fmax(cov[i * states + i] - known, 0);
    }
}
