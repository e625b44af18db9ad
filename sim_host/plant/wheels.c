#include "plant/wheels.h"

#include <math.h>

/* s^2 / (1 + s^2) of wheels.h, for the motion with the least inertia. */
static double stiffness(const wheels_t *wheels, const motor_t *motor, int k, double h)
{
    const double loss = k == 0 ? wheels->drag.left : wheels->drag.right;
    const double inertia = (k == 0 ? wheels->inertia.left : wheels->inertia.right) - fabs(wheels->inertia.cross);
    const double braking = wheels->floats[k] ? 0 : motor->torque_constant * motor->emf_constant / motor->resistance;
    const double s = h * (loss + braking) / inertia;
    return s * s / (1 + s * s);
}

void wheels_prepare(wheels_t *wheels, const vehicle_t *vehicle, double h)
{
    for (int k = 0; k < 2; k++) {
        wheels->floats[k] = isnan(vehicle->voltage[k]);
        const double stiff = stiffness(wheels, &vehicle->motor[k], k, h);
        motor_prepare(&wheels->motor[k], &vehicle->motor[k], h, wheels->floats[k], stiff);
        wheels->weight[k] = 0.5 * h * (1 + stiff);
    }
    wheels->step = h;
    wheels_join(wheels);
}

void wheels_join(wheels_t *wheels)
{
    const pair_t *inertia = &wheels->inertia, *drag = &wheels->drag;
    const double *weight = wheels->weight;
    const double h = wheels->step;
    const double cross_weight = weight[0] > weight[1] ? weight[1] : weight[0];
    const pair_t a = {.left = inertia->left + weight[0] * drag->left + h * motor_damping(&wheels->motor[0]),
                      .right = inertia->right + weight[1] * drag->right + h * motor_damping(&wheels->motor[1]),
                      .cross = inertia->cross + cross_weight * drag->cross};
    const double scale = 1 / (a.left * a.right - a.cross * a.cross);
    wheels->matrix = a;
    wheels->inverse = (pair_t){.left = a.right * scale, .right = a.left * scale, .cross = -a.cross * scale};
}

static pair_t scaled(const pair_t *matrix, double left, double right)
{
    return (pair_t){matrix->left * left * left, matrix->right * right * right, matrix->cross * left * right};
}

/* Solves in the speeds of the rims: their sum is the surge and their difference the yaw, whatever the radii. */
static void solve_rims(double end[2], const wheels_t *wheels, const double rim[2], double bound[DRY_COUNT])
{
    const double left = rim[0], right = rim[1];
    bound[DRY_LEFT] /= left;
    bound[DRY_RIGHT] /= right;
    const pair_t matrix = scaled(&wheels->matrix, 1 / left, 1 / right);
    const pair_t inverse = scaled(&wheels->inverse, left, right);
    end[0] *= left;
    end[1] *= right;
    dry_solve(end, &matrix, &inverse, bound);
    end[0] /= left;
    end[1] /= right;
}

static void solve_dry(double end[2], const wheels_t *wheels, const vehicle_t *vehicle)
{
    double bound[DRY_COUNT];
    double sum = 0;
    for (int i = 0; i < DRY_COUNT; i++) {
        bound[i] = wheels->step * wheels->dry_arm[i] * vehicle->dry[i];
        sum += bound[i];
    }
    if (sum > 0)
        solve_rims(end, wheels, vehicle->build.rim, bound);
}

void wheels_step(wheels_t *wheels, vehicle_t *vehicle)
{
    bp_state *state = &vehicle->state;
    const double h = wheels->step;
    const pair_t *drag = &wheels->drag, *inverse = &wheels->inverse;
    const double speed[2] = {state->wheel_speed[0], state->wheel_speed[1]};
    const double lost[2] = {drag->left * speed[0] + drag->cross * speed[1],
                            drag->right * speed[1] + drag->cross * speed[0]};
    double voltage[2], mean_current[2], impulse[2];

    for (int k = 0; k < 2; k++) {
        const motor_step_t *motor = &wheels->motor[k];
        voltage[k] = wheels->floats[k] ? 0 : vehicle->voltage[k];
        mean_current[k] = motor_mean_current(motor, voltage[k], speed[k], state->current[k]);
        const double torque = motor->torque_constant * mean_current[k] + motor->torque_per_volt * voltage[k];
        impulse[k] = h * (torque - lost[k] + wheels->load[k] + vehicle->wheel_torque[k]);
    }
    double end[2] = {speed[0] + (inverse->left * impulse[0] + inverse->cross * impulse[1]),
                     speed[1] + (inverse->right * impulse[1] + inverse->cross * impulse[0])};
    solve_dry(end, wheels, vehicle);

    for (int k = 0; k < 2; k++) {
        const motor_step_t *motor = &wheels->motor[k];
        const double change = end[k] - speed[k];
        mean_current[k] -= motor->mean_ramp * motor->emf_constant * change;
        wheels->energy[k] += h * voltage[k] * mean_current[k];
        state->current[k] = motor_end_current(motor, voltage[k], speed[k], change, state->current[k]);
        state->wheel_angle[k] += 0.5 * h * (speed[k] + end[k]);
        state->wheel_speed[k] = end[k];
    }
}
