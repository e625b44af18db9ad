#include "run/predictor.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "plant/contact_load.h"

/* Least step of a finite difference, over the natural size of what it changes. Below it rounding would show. */
static const double LEAST_STEP = 1e-5;

/* L / R over the median interval, above which a current is part of the estimate. */
static const double SLOW_CURRENT = 0.2;

typedef enum { WHEEL_SPEED, WHEEL_ANGLE = 2, SURGE = 4, SWAY, YAW_RATE, HEADING, CURRENT } field_t;

static const struct {
    const char *name, *unit;
    size_t at; /* in bp_state */
} FIELD[BP_ESTIMATES] = {
    {"wheel_speed_left", "rad/s", offsetof(bp_state, wheel_speed)},
    {"wheel_speed_right", "rad/s", offsetof(bp_state, wheel_speed) + sizeof(double)},
    {"wheel_angle_left", "rad", offsetof(bp_state, wheel_angle)},
    {"wheel_angle_right", "rad", offsetof(bp_state, wheel_angle) + sizeof(double)},
    {"surge", "m/s", offsetof(bp_state, surge)},
    {"sway", "m/s", offsetof(bp_state, sway)},
    {"yaw_rate", "rad/s", offsetof(bp_state, yaw_rate)},
    {"heading", "rad", offsetof(bp_state, heading)},
    {"current_left", "A", offsetof(bp_state, current)},
    {"current_right", "A", offsetof(bp_state, current) + sizeof(double)},
    {"torque_left", "N m", 0},
    {"torque_right", "N m", 0},
    {"force_surge", "N", 0},
    {"moment_yaw", "N m", 0},
};

const char *bp_estimate_name(int index)
{
    return index < 0 || index >= BP_ESTIMATES ? NULL : FIELD[index].name;
}

const char *bp_estimate_unit(int index)
{
    return index < 0 || index >= BP_ESTIMATES ? NULL : FIELD[index].unit;
}

static double *field_of(bp_state *state, int field)
{
    return (double *)((char *)state + FIELD[field].at);
}

double walk_variance(double decay, double dt)
{
    return decay > 0 ? -0.5 * decay * expm1(-2 * dt / decay) : dt;
}

static double kept(double decay, double dt)
{
    return decay > 0 ? exp(-dt / decay) : 1;
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median_interval(const bp_run *run)
{
    const int count = run->samples - 1;
    double *intervals = count > 0 ? malloc((size_t)count * sizeof *intervals) : NULL;
    if (intervals == NULL)
        return INFINITY;
    for (int k = 0; k < count; k++)
        intervals[k] = run->time[k + 1] - run->time[k];
    qsort(intervals, (size_t)count, sizeof *intervals, compare);
    const double median = intervals[count / 2];
    free(intervals);
    return median;
}

static bool measures(const bp_prediction *given, output_t first, output_t last)
{
    for (int i = 0; i < given->measured_count; i++)
        if (given->measured_output[i] >= (int)first && given->measured_output[i] <= (int)last)
            return true;
    return false;
}

static void add(layout_t *layout, int field, bool wanted)
{
    if (wanted)
        layout->field[layout->plant_states++] = field;
}

static void lay_out(layout_t *layout, const bp_prediction *given, const vehicle_t *vehicle)
{
    const int wheels = vehicle_wheels(vehicle);
    const bool drives = wheels == 2;
    const bool apart = drives && (vehicle->profile == BP_PAPER || vehicle->build.along.creep > 0);
    const bool slides = drives && (vehicle->profile == BP_PAPER || vehicle->build.across.creep > 0);
    const bool angles = measures(given, OUTPUT_WHEEL_ANGLE_LEFT, OUTPUT_WHEEL_TRAVEL_RIGHT) ||
                        measures(given, OUTPUT_ANGLE, OUTPUT_POSITION);
    const double slow = SLOW_CURRENT * median_interval(&given->run);
    *layout = (layout_t){0};
    for (int side = 0; side < wheels; side++) {
        const motor_t *motor = &vehicle->motor[side];
        add(layout, WHEEL_SPEED + side, true);
        add(layout, WHEEL_ANGLE + side, angles);
        add(layout, CURRENT + side, motor->torque_constant > 0 && motor->inductance > slow * motor->resistance);
    }
    add(layout, SURGE, apart);
    add(layout, YAW_RATE, apart);
    add(layout, SWAY, slides);
    add(layout, HEADING, drives && measures(given, OUTPUT_YAW_ANGLE, OUTPUT_YAW_ANGLE));
    for (int i = 0; i < (drives ? BP_LOADS : 1); i++)
        if (given->white[i] > 0 || given->walk[i] > 0)
            layout->load[layout->loads++] = i;
    for (int i = 0; i < given->measured_count; i++)
        if (given->drift[i] > 0)
            layout->drift[layout->drifts++] = i;
    layout->states = layout->plant_states + layout->loads + layout->drifts;
}

predictor_t *predictor_new(bp_prediction *given)
{
    const size_t copies = TRACKED + BP_LOADS;
    predictor_t *p = calloc(1, sizeof *p + copies * sizeof(plant_t));
    if (p != NULL)
        p->given = given;
    return p;
}

void predictor_free(predictor_t *p)
{
    free(p);
}

static void set_floors(predictor_t *p)
{
    const layout_t *layout = &p->layout;
    const vehicle_t *vehicle = &p->mean.vehicle;
    const motor_t *motor = &vehicle->motor[0];
    const double volts = vehicle->parameter[PARAMETER_BATTERY_VOLTAGE];
    const double torque = (motor->torque_constant / motor->resistance + motor->torque_per_volt) * volts;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const double lever = radius > 0 ? radius : 1;
    const double most[BP_LOADS] = {torque, torque, torque / lever,
                                   torque / lever * vehicle->parameter[PARAMETER_HALF_TRACK]};
    for (int i = 0; i < layout->plant_states; i++)
        p->floor[i] = LEAST_STEP;
    for (int i = 0; i < layout->loads; i++)
        p->floor[layout->plant_states + i] = LEAST_STEP * most[layout->load[i]];
}

static void start_estimate(predictor_t *p)
{
    const bp_prediction *given = p->given;
    const layout_t *layout = &p->layout;
    kalman_t *kalman = &p->kalman;
    kalman->states = layout->states;
    kalman->rows = layout->states + given->measured_count;
    for (int i = 0; i < layout->states; i++) {
        const int load = i - layout->plant_states, drift = load - layout->loads;
        double variance;
        if (load < 0)
            variance = given->start_sd[layout->field[i]] * given->start_sd[layout->field[i]];
        else if (drift < 0)
            variance = 0.5 * given->decay * given->walk[layout->load[load]] * given->walk[layout->load[load]];
        else
            variance =
                0.5 * given->drift_decay * given->drift[layout->drift[drift]] * given->drift[layout->drift[drift]];
        kalman->cov[i * kalman->rows + i] = variance;
        kalman->mean[i] = load < 0 ? *field_of(&p->mean.vehicle.state, layout->field[i]) : 0;
    }
}

int predictor_start(predictor_t *p)
{
    const bp_prediction *given = p->given;
    const bp_run *run = &given->run;
    int status = plant_start(&p->mean, run->model, &run->initial, run->motor_step, run->body_step);
    if (status == 0)
        status = plant_start(&p->ahead, run->model, &run->initial, run->motor_step, run->body_step);
    if (status != 0)
        return status;
    double out[OUTPUT_COUNT];
    plant_outputs(&p->mean, out);
    for (int i = 0; i < given->measured_count; i++)
        if (isnan(out[given->measured_output[i]]))
            return BP_E_RANGE;
    lay_out(&p->layout, given, &p->mean.vehicle);
    for (int i = 0; i < p->layout.plant_states + p->layout.loads && status == 0; i++)
        status = plant_start(&p->copy[i], run->model, &run->initial, run->motor_step, run->body_step);
    set_floors(p);
    start_estimate(p);
    return status;
}

void predictor_input(const predictor_t *p, int k, double input[2])
{
    const bp_run *run = &p->given->run;
    const int inputs = run->model->vehicle == BP_MOTOR ? 1 : 2;
    const double *given = run->input + (ptrdiff_t)k * inputs;
    input[0] = given[0];
    input[1] = inputs == 2 ? given[1] : 0;
}

/* Reads the predicted state and readings off a plant: plant states, and outputs behind all states. */
static void read_rows(const predictor_t *p, plant_t *plant, double *rows)
{
    double out[OUTPUT_COUNT];
    plant_outputs(plant, out);
    for (int i = 0; i < p->layout.plant_states; i++)
        rows[i] = *field_of(&plant->vehicle.state, p->layout.field[i]);
    for (int i = 0; i < p->given->measured_count; i++)
        rows[p->layout.states + i] = out[p->given->measured_output[i]];
}

/* Advances a copy of the plant that is a step apart in state i, and returns the step. */
static int advance_copy(predictor_t *p, int i, const double input[2], double dt, double *step)
{
    plant_t *copy = &p->copy[i];
    const layout_t *layout = &p->layout;
    const double own = sqrt(fmax(p->kalman.cov[i * p->kalman.rows + i], 0));
    *step = own > p->floor[i] ? own : p->floor[i];
    plant_copy(copy, &p->mean);
    if (i < layout->plant_states) {
        bp_state state = copy->vehicle.state;
        *field_of(&state, layout->field[i]) += *step;
        plant_move(copy, &state);
    } else {
        double push[PUSH_COUNT];
        memcpy(push, copy->push, sizeof push);
        push[layout->load[i - layout->plant_states]] += *step;
        plant_push(copy, push);
    }
    return plant_advance(copy, input, dt);
}

/* What follows from a state alone: loads and drifts decay, and a drift shows in its reading. */
static void fill_decays(const predictor_t *p, double dt, double *slope)
{
    const layout_t *layout = &p->layout;
    const int states = layout->states;
    for (int i = 0; i < layout->loads; i++) {
        const int row = layout->plant_states + i;
        slope[row * states + row] = kept(p->given->decay, dt);
    }
    for (int i = 0; i < layout->drifts; i++) {
        const int row = layout->plant_states + layout->loads + i;
        slope[row * states + row] = kept(p->given->drift_decay, dt);
        slope[(states + layout->drift[i]) * states + row] = slope[row * states + row];
    }
}

static void drive(predictor_t *p, const double *slope, double dt)
{
    const bp_prediction *given = p->given;
    double driver[KALMAN_ROWS];
    for (int i = 0; i < p->layout.loads; i++) {
        const double white = given->white[p->layout.load[i]], walk = given->walk[p->layout.load[i]];
        predictor_white_driver(p, i, slope, driver);
        kalman_drive(&p->kalman, driver, white * white / dt);
        predictor_walk_driver(p, i, driver);
        kalman_drive(&p->kalman, driver, walk * walk * walk_variance(given->decay, dt));
    }
    for (int i = 0; i < p->layout.drifts; i++) {
        const double sd = given->drift[p->layout.drift[i]];
        predictor_drift_driver(p, i, driver);
        kalman_drive(&p->kalman, driver, sd * sd * walk_variance(given->drift_decay, dt));
    }
}

int predictor_step(predictor_t *p, const double input[2], double dt, double *slope)
{
    const layout_t *layout = &p->layout;
    const int states = layout->states, rows = p->kalman.rows, moved = layout->plant_states + layout->loads;
    double step[KALMAN_STATES], mean[KALMAN_ROWS], apart[KALMAN_ROWS];
    memset(slope, 0, (size_t)(rows * states) * sizeof *slope);
    for (int i = 0; i < moved; i++) {
        const int status = advance_copy(p, i, input, dt, &step[i]);
        if (status != 0)
            return status;
    }
    const int status = plant_advance(&p->mean, input, dt);
    if (status != 0)
        return status;
    read_rows(p, &p->mean, mean);
    for (int i = 0; i < moved; i++) {
        read_rows(p, &p->copy[i], apart);
        for (int row = 0; row < rows; row++)
            if (row < layout->plant_states || row >= states)
                slope[row * states + i] = (apart[row] - mean[row]) / step[i];
    }
    fill_decays(p, dt, slope);
    for (int row = layout->plant_states; row < states; row++)
        mean[row] = slope[row * states + row] * p->kalman.mean[row];
    for (int i = 0; i < layout->drifts; i++)
        mean[states + layout->drift[i]] += mean[moved + i];
    memcpy(p->kalman.mean, mean, (size_t)rows * sizeof *mean);
    kalman_predict(&p->kalman, slope);
    drive(p, slope, dt);
    return 0;
}

void predictor_take_over(predictor_t *p)
{
    const layout_t *layout = &p->layout;
    bp_state state = p->mean.vehicle.state;
    double push[PUSH_COUNT] = {0};
    for (int i = 0; i < layout->plant_states; i++)
        *field_of(&state, layout->field[i]) = p->kalman.mean[i];
    for (int i = 0; i < layout->loads; i++)
        push[layout->load[i]] = p->kalman.mean[layout->plant_states + i];
    plant_move(&p->mean, &state);
    plant_push(&p->mean, push);
}

void predictor_white_driver(const predictor_t *p, int i, const double *slope, double *driver)
{
    const layout_t *layout = &p->layout;
    const int column = layout->plant_states + i;
    for (int row = 0; row < p->kalman.rows; row++)
        driver[row] = slope[row * layout->states + column];
    driver[column] = 0;
}

void predictor_walk_driver(const predictor_t *p, int i, double *driver)
{
    memset(driver, 0, (size_t)p->kalman.rows * sizeof *driver);
    driver[p->layout.plant_states + i] = 1;
}

void predictor_drift_driver(const predictor_t *p, int i, double *driver)
{
    memset(driver, 0, (size_t)p->kalman.rows * sizeof *driver);
    driver[p->layout.plant_states + p->layout.loads + i] = 1;
    driver[p->layout.states + p->layout.drift[i]] = 1;
}

void predictor_report(const predictor_t *p, int k, double *rows)
{
    if (rows == NULL)
        return;
    double *row = rows + (ptrdiff_t)k * BP_ESTIMATES;
    bp_state state = p->mean.vehicle.state;
    for (int i = 0; i < TRACKED; i++)
        row[i] = *field_of(&state, i);
    for (int i = 0; i < BP_LOADS; i++)
        row[TRACKED + i] = p->mean.pushed ? p->mean.push[i] : 0;
}

void predictor_report_smoothed(const predictor_t *p, int k, const double *smoothed, const double *variance)
{
    const bp_prediction *given = p->given;
    const layout_t *layout = &p->layout;
    for (int i = 0; i < layout->states; i++) {
        const int load = i - layout->plant_states, drift = load - layout->loads;
        const int column = load < 0 ? layout->field[i] : drift < 0 ? TRACKED + layout->load[load] : -1;
        if (column >= 0) {
            given->smoothed[(ptrdiff_t)k * BP_ESTIMATES + column] = smoothed[i];
            given->smoothed_sd[(ptrdiff_t)k * BP_ESTIMATES + column] = sqrt(variance[i]);
        } else if (given->smoothed_drift != NULL) {
            given->smoothed_drift[(ptrdiff_t)k * given->measured_count + layout->drift[drift]] = smoothed[i];
        }
    }
}
