#include "effects/composed_laws.h"

#include <math.h>

static const double PI = 3.14159265358979323846;

#define ADD(name, unit, low, odd, expression)                                                                          \
    if (*c != 0)                                                                                                       \
        sum += *c * (expression);                                                                                      \
    c++;

double composed_drive_gain(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double V = at->V, w = at->w, t = at->t, frequency = given->frequency;
    double sum = 0;
    COMPOSED_DRIVE_GAIN(ADD)
    return sum;
}

double composed_drive_add(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double V = at->V, other = at->other, t = at->t, frequency = given->frequency;
    double sum = 0;
    COMPOSED_DRIVE_ADD(ADD)
    return sum;
}

double composed_wheel_dry(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double V = at->V, i = at->i, w = at->w, theta = at->theta, t = at->t, order = given->order;
    double sum = 0;
    COMPOSED_WHEEL_DRY(ADD)
    return sum;
}

double composed_wheel_loss(const double *c, const composed_t *given, const composed_point_t *at)
{
    (void)given;
    const double w = at->w, t = at->t;
    double sum = 0;
    COMPOSED_WHEEL_LOSS(ADD)
    return sum;
}

double composed_wheel_gain(const double *c, const composed_t *given, const composed_point_t *at)
{
    (void)given;
    const double i = at->i;
    double sum = 0;
    COMPOSED_WHEEL_GAIN(ADD)
    return sum;
}

double composed_wheel_push(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double theta = at->theta, t = at->t, order = given->order, frequency = given->frequency;
    double sum = 0;
    COMPOSED_WHEEL_PUSH(ADD)
    return sum;
}

double composed_surge_dry(const double *c, const composed_t *given, const composed_point_t *at)
{
    (void)given;
    const double r = at->r, t = at->t, patch = at->patch;
    double sum = 0;
    COMPOSED_SURGE_DRY(ADD)
    return sum;
}

double composed_surge_loss(const double *c, const composed_t *given, const composed_point_t *at)
{
    (void)given;
    const double u = at->u, r = at->r, t = at->t, patch = at->patch;
    double sum = 0;
    COMPOSED_SURGE_LOSS(ADD)
    return sum;
}

double composed_surge_push(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double r = at->r, psi = at->psi, x = at->x, y = at->y, t = at->t, patch = at->patch, sprung = at->sprung;
    const double frequency = given->frequency, wavelength = given->wavelength;
    double sum = 0;
    COMPOSED_SURGE_PUSH(ADD)
    return sum;
}

double composed_yaw_dry(const double *c, const composed_t *given, const composed_point_t *at)
{
    (void)given;
    const double u = at->u, t = at->t, patch = at->patch;
    double sum = 0;
    COMPOSED_YAW_DRY(ADD)
    return sum;
}

double composed_yaw_loss(const double *c, const composed_t *given, const composed_point_t *at)
{
    (void)given;
    const double u = at->u, r = at->r, t = at->t, patch = at->patch;
    double sum = 0;
    COMPOSED_YAW_LOSS(ADD)
    return sum;
}

double composed_yaw_push(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double u = at->u, psi = at->psi, x = at->x, t = at->t, sprung = at->sprung;
    const double frequency = given->frequency, wavelength = given->wavelength;
    double sum = 0;
    COMPOSED_YAW_PUSH(ADD)
    return sum;
}

double composed_floor_add(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double x = at->x, patch = at->patch, wavelength = given->wavelength;
    double sum = 0;
    COMPOSED_FLOOR_ADD(ADD)
    return sum;
}

double composed_encoder_gain(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double w = at->w, theta = at->theta, t = at->t, order = given->order;
    double sum = 0;
    COMPOSED_ENCODER_GAIN(ADD)
    return sum;
}

double composed_gyro_add(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double u = at->u, r = at->r, a = at->a, b = at->b, i_left = at->i_left, i_right = at->i_right, t = at->t;
    const double frequency = given->frequency;
    double sum = 0;
    COMPOSED_GYRO_ADD(ADD)
    return sum;
}

double composed_accel_surge_add(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double u = at->u, r = at->r, a = at->a, b = at->b, i_left = at->i_left, i_right = at->i_right, t = at->t;
    const double frequency = given->frequency;
    double sum = 0;
    COMPOSED_ACCEL_SURGE_ADD(ADD)
    return sum;
}

double composed_accel_sway_add(const double *c, const composed_t *given, const composed_point_t *at)
{
    const double u = at->u, r = at->r, a = at->a, b = at->b, i_left = at->i_left, i_right = at->i_right, t = at->t;
    const double frequency = given->frequency;
    double sum = 0;
    COMPOSED_ACCEL_SWAY_ADD(ADD)
    return sum;
}
