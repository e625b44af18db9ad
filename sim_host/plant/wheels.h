/* wheels.h: both motors and wheels over one motor step: eq. 14, the contact's inertia and load, and dry friction.
 *
 * The linear part is integrated by the implicit midpoint rule: (M + h/2 D + h K) dw = h (torque(w) + load) + p. M is
 * the inertia that the wheels feel, D the linear losses, K the motors' damping within the step, and p the impulse of
 * dry friction. If a step does not resolve the motion, the factor 1/2 grows to 1 (implicit Euler) with s^2 / (1 + s^2),
 * where s = h (D + K_t K_e / R) / M.
 */
#ifndef BRICKPILOT_PLANT_WHEELS_H
#define BRICKPILOT_PLANT_WHEELS_H

#include "plant/dry.h"
#include "plant/motor.h"

/* Speeds of the tyres over the floor, m/s. */
typedef struct {
    real_t along[2]; /* speed of each wheel's rim minus that of the body */
    real_t sway;     /* of both tyres, sideways */
    real_t yaw_rate; /* rad/s; of a skid steer: it adds to sway, times a contact's distance ahead */
} slip_t;

typedef struct {
    /* Set by the contact for a body step. */
    pair_t inertia; /* kg m^2: M */
    pair_t drag;    /* N m s/rad: D */
    real_t load[2]; /* N m, driving forward */
    real_t dry_arm
        [DRY_COUNT]; /* factor from vehicle_t.dry to N m at the wheel; 0 where the wheels do not carry the motion */

    /* Only the contact uses these, if the body has its own speeds. Ground speeds are those of the body at each wheel,
     * in m/s. */
    struct {
        pair_t inverse;                   /* 1/kg: change of the ground speeds per impulse at the wheels */
        pair_t grip;                      /* kg: impulse on the body per wheel speed ahead of `free` */
        pair_t mass;                      /* kg: inverse of `inverse` */
        real_t free[2];                   /* m/s: ground speeds at the end of the step without tyre force */
        real_t sway_impulse;              /* N s: impulse on the sway, tyres included */
        real_t sway_mass;                 /* kg: mass that this impulse moves, tyres included */
        real_t sway_lever;                /* kg m: sway impulse that a change of the yaw rate takes */
        real_t travel_surge, travel_sway; /* m: travel since the body step began */
        real_t turn;                      /* rad: turn since the body step began */
        slip_t slip;                      /* slip at the start of the motor step; valid only if has_slip */
        bool has_slip;
        slip_t ahead;   /* slip expected at the end of the motor step: the tyres' law is linearised there */
        real_t turned;  /* kg m^2: yaw impulse of the contacts per yaw rate in this step, for `ahead` */
        real_t soft[2]; /* 1/kg: slip speed per impulse of each tyre in this step, for `ahead` */
    } body;

    /* Set by wheels_prepare(). */
    double step; /* s */
    mask_t floats[2];
    motor_step_t motor[2];
    real_t weight[2]; /* s: h/2; larger if the step is stiff */
    pair_t matrix;    /* M + h/2 D + h K */
    pair_t inverse;

    real_t energy[2]; /* J: energy from the drive into each motor since the caller set this to 0 */
} wheels_t;

/* s^2 / (1 + s^2) of wheels.h, for the motion with the least inertia. */
static inline real_t wheels_stiffness(const wheels_t *wheels, const motor_t *motor, int k, double h)
{
    const real_t loss = k == 0 ? wheels->drag.left : wheels->drag.right;
    const real_t inertia = (k == 0 ? wheels->inertia.left : wheels->inertia.right) - real_abs(wheels->inertia.cross);
    const real_t braking =
        choose(wheels->floats[k], real_of(0), motor->torque_constant * motor->emf_constant / motor->resistance);
    const real_t s = h * (loss + braking) / inertia;
    return s * s / (1 + s * s);
}

/* Computes the coefficients that follow from the inertia alone. Call it when the contact has changed the inertia within
 * a body step. */
static inline void wheels_join(wheels_t *wheels)
{
    const pair_t *inertia = &wheels->inertia, *drag = &wheels->drag;
    const real_t *weight = wheels->weight;
    const double h = wheels->step;
    const real_t cross_weight = choose(weight[0] > weight[1], weight[1], weight[0]);
    const pair_t a = {.left = inertia->left + weight[0] * drag->left + h * motor_damping(&wheels->motor[0]),
                      .right = inertia->right + weight[1] * drag->right + h * motor_damping(&wheels->motor[1]),
                      .cross = inertia->cross + cross_weight * drag->cross};
    const real_t scale = 1 / (a.left * a.right - a.cross * a.cross);
    wheels->matrix = a;
    wheels->inverse = (pair_t){.left = a.right * scale, .right = a.left * scale, .cross = -a.cross * scale};
}

/* Computes all coefficients anew. Call it when the contact, the step h or a motor has changed, or a motor has begun or
 * stopped floating. */
static inline void wheels_prepare(wheels_t *wheels, const vehicle_t *vehicle, double h)
{
    for (int k = 0; k < 2; k++) {
        wheels->floats[k] = is_nan(vehicle->voltage[k]);
        const real_t stiff = wheels_stiffness(wheels, &vehicle->motor[k], k, h);
        motor_prepare(&wheels->motor[k], &wheels->motor[1 - k], &vehicle->motor[k], h, wheels->floats[k], stiff);
        wheels->weight[k] = 0.5 * h * (1 + stiff);
    }
    wheels->step = h;
    wheels_join(wheels);
}

static inline pair_t wheels_scaled(const pair_t *matrix, real_t left, real_t right)
{
    return (pair_t){matrix->left * left * left, matrix->right * right * right, matrix->cross * left * right};
}

/* Solves for the speeds of the rims: for any radii, their sum gives the surge and their difference the yaw. Leaves
 * `end` unchanged if `rubs` is false. */
static inline void wheels_solve_rims(real_t end[2], const wheels_t *wheels, const real_t rim[2],
                                     real_t bound[DRY_COUNT], mask_t rubs)
{
    const real_t left = rim[0], right = rim[1];
    bound[DRY_LEFT] /= left;
    bound[DRY_RIGHT] /= right;
    const pair_t matrix = wheels_scaled(&wheels->matrix, 1 / left, 1 / right);
    const pair_t inverse = wheels_scaled(&wheels->inverse, left, right);
    real_t speed[2] = {end[0] * left, end[1] * right};
    dry_solve(speed, &matrix, &inverse, bound);
    end[0] = choose(rubs, speed[0] / left, end[0]);
    end[1] = choose(rubs, speed[1] / right, end[1]);
}

static inline void wheels_solve_dry(real_t end[2], const wheels_t *wheels, const vehicle_t *vehicle)
{
    real_t bound[DRY_COUNT];
    real_t sum = real_of(0);
    for (int i = 0; i < DRY_COUNT; i++) {
        bound[i] = wheels->step * wheels->dry_arm[i] * vehicle->dry[i];
        sum += bound[i];
    }
    const mask_t rubs = sum > 0;
    if (any_lane(rubs))
        wheels_solve_rims(end, wheels, vehicle->build.rim, bound, rubs);
}

/* Does one motor step with vehicle->voltage, wheel_torque and dry: changes current, wheel_speed and wheel_angle of the
 * state. */
static inline void wheels_step(wheels_t *wheels, vehicle_t *vehicle)
{
    state_t *state = &vehicle->state;
    const double h = wheels->step;
    const pair_t *drag = &wheels->drag, *inverse = &wheels->inverse;
    const real_t speed[2] = {state->wheel_speed[0], state->wheel_speed[1]};
    const real_t lost[2] = {drag->left * speed[0] + drag->cross * speed[1],
                            drag->right * speed[1] + drag->cross * speed[0]};
    real_t voltage[2], mean_current[2], impulse[2];

    for (int k = 0; k < 2; k++) {
        const motor_step_t *motor = &wheels->motor[k];
        voltage[k] = choose(wheels->floats[k], real_of(0), vehicle->voltage[k]);
        mean_current[k] = motor_mean_current(motor, voltage[k], speed[k], state->current[k]);
        const real_t torque = motor->torque_constant * mean_current[k] + motor->torque_per_volt * voltage[k];
        impulse[k] = h * (torque - lost[k] + wheels->load[k] + vehicle->wheel_torque[k]);
    }
    real_t end[2] = {speed[0] + (inverse->left * impulse[0] + inverse->cross * impulse[1]),
                     speed[1] + (inverse->right * impulse[1] + inverse->cross * impulse[0])};
    wheels_solve_dry(end, wheels, vehicle);

    for (int k = 0; k < 2; k++) {
        const motor_step_t *motor = &wheels->motor[k];
        const real_t change = end[k] - speed[k];
        mean_current[k] -= motor->mean_ramp * motor->emf_constant * change;
        wheels->energy[k] += h * voltage[k] * mean_current[k];
        state->current[k] = motor_end_current(motor, voltage[k], speed[k], change, state->current[k]);
        state->wheel_angle[k] += 0.5 * h * (speed[k] + end[k]);
        state->wheel_speed[k] = end[k];
    }
}

#endif
