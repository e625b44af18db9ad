/* motor.h: eq. 12, exact over a motor step in which the wheel speed changes linearly.
 *
 * With a = h R / L and phi_1 = (1 - e^-a) / a, phi_2 = (1 - phi_1) / a, phi_3 = (1/2 - phi_2) / a:
 *   i(h)   = e^-a i + (1 - e^-a) / R e - (1 - phi_1) / R K_e dw
 *   mean i = phi_1 i + (1 - phi_1) / R e - (1/2 - phi_2) / R K_e dw          e = V - K_e w, dw = the change of w
 * and i = (V - K_e w) / R for L -> 0. This is an integrating factor: Hochbruck & Ostermann 2010. If a step does not
 * resolve the motion (`stiffness` near 1), the last factor goes from 1/2 - phi_2 to 1: the motion is damped and does
 * not ring. The stiffness is of second order in h, so the method stays of order 2.
 */
#ifndef BRICKPILOT_PLANT_MOTOR_H
#define BRICKPILOT_PLANT_MOTOR_H

#include "effects/vehicle.h"

/* Coefficients that depend on step, resistance and inductance alone, and the values that they were computed for. */
typedef struct {
    real_t of_step, of_resistance, of_inductance;
    real_t decay;      /* e^-a */
    real_t gain;       /* (1 - e^-a) / R */
    real_t mean_decay; /* phi_1 */
    real_t mean_gain;  /* (1 - phi_1) / R */
    real_t a_phi_3;
} motor_settled_t;

typedef struct {
    real_t emf_constant;
    real_t torque_constant;
    real_t torque_per_volt;
    real_t decay; /* this and the next three: of motor_settled_t, but 0 if the motor floats */
    real_t gain;
    real_t mean_decay;
    real_t mean_gain;
    real_t mean_ramp; /* (1/2 - phi_2) / R; larger if the step is stiff */
    motor_settled_t settled;
} motor_step_t;

/* 1 - a phi_1 = e^-a, 1 - a phi_2 = phi_1, 1/2 - a phi_3 = phi_2: kept as products with a, which stay finite as L -> 0.
 */
typedef struct {
    real_t phi_1;
    real_t a_phi_1, a_phi_2, a_phi_3;
} motor_phi_t;

/* For small a the closed forms lose digits. So phi_3 is summed from its series, and the other values follow from
 * phi_3. */
static inline motor_phi_t motor_phi_of_small(real_t a)
{
    motor_phi_t phi;
    real_t series = real_of(0);
    for (int n = 16; n >= 0; n--)
        series = (1 - a * series) / (n + 3);
    phi.a_phi_3 = 0.5 * a * series;
    const real_t phi_2 = 0.5 - phi.a_phi_3;
    phi.a_phi_2 = a * phi_2;
    phi.phi_1 = 1 - phi.a_phi_2;
    phi.a_phi_1 = a * phi.phi_1;
    return phi;
}

static inline motor_phi_t motor_phi_of_large(real_t a)
{
    motor_phi_t phi;
    phi.a_phi_1 = 1 - real_exp(-a);
    phi.phi_1 = phi.a_phi_1 / a;
    phi.a_phi_2 = 1 - phi.phi_1;
    const real_t phi_2 = phi.a_phi_2 / a;
    phi.a_phi_3 = 0.5 - phi_2;
    return phi;
}

static inline motor_phi_t motor_phi_choose(mask_t mask, motor_phi_t yes, motor_phi_t no)
{
    return (motor_phi_t){.phi_1 = choose(mask, yes.phi_1, no.phi_1),
                         .a_phi_1 = choose(mask, yes.a_phi_1, no.a_phi_1),
                         .a_phi_2 = choose(mask, yes.a_phi_2, no.a_phi_2),
                         .a_phi_3 = choose(mask, yes.a_phi_3, no.a_phi_3)};
}

/* Without inductance the current follows the voltage at once. */
static inline motor_phi_t motor_phi(const motor_t *motor, double h)
{
    const mask_t lags = motor->inductance > 0;
    motor_phi_t phi = {real_of(0), real_of(1), real_of(1), real_of(0.5)};
    if (!any_lane(lags))
        return phi;
    const real_t a = h * motor->resistance / motor->inductance;
    const mask_t small = a < 0.5;
    if (any_lane(lags & small))
        phi = motor_phi_choose(lags & small, motor_phi_of_small(a), phi);
    if (any_lane(lags & mask_not(small)))
        phi = motor_phi_choose(lags & mask_not(small), motor_phi_of_large(a), phi);
    return phi;
}

static inline void motor_settle(motor_settled_t *settled, const motor_t *motor, double h)
{
    const motor_phi_t phi = motor_phi(motor, h);
    settled->decay = 1 - phi.a_phi_1;
    settled->gain = phi.a_phi_1 / motor->resistance;
    settled->mean_decay = phi.phi_1;
    settled->mean_gain = phi.a_phi_2 / motor->resistance;
    settled->a_phi_3 = phi.a_phi_3;
    settled->of_step = real_of(h);
    settled->of_resistance = motor->resistance;
    settled->of_inductance = motor->inductance;
}

/* True if `settled` already has the values that motor_settle() would compute. */
IN_LANES mask_t motor_settled(const motor_settled_t *settled, const motor_t *motor, double h)
{
    const mask_t step = settled->of_step == h, resistance = settled->of_resistance == motor->resistance;
    const mask_t inductance = settled->of_inductance == motor->inductance;
    return step & resistance & inductance;
}

/* Fills the coefficients for motor steps of h seconds; stiffness 0..1. A motor that floats carries no current. `step`
 * is all zero, or was prepared before: coefficients that depend on step, resistance and inductance alone are computed
 * only when one of these has changed. If `other`, the motor of the other side, has them, they are taken from it. */
static inline void motor_prepare(motor_step_t *step, const motor_step_t *other, const motor_t *motor, double h,
                                 mask_t floats, real_t stiffness)
{
    motor_settled_t *settled = &step->settled;
    if (!all_lanes(motor_settled(settled, motor, h))) {
        if (all_lanes(motor_settled(&other->settled, motor, h)))
            *settled = other->settled;
        else
            motor_settle(settled, motor, h);
    }
    const real_t none = real_of(0);
    step->decay = choose(floats, none, settled->decay);
    step->gain = choose(floats, none, settled->gain);
    step->mean_decay = choose(floats, none, settled->mean_decay);
    step->mean_gain = choose(floats, none, settled->mean_gain);
    step->emf_constant = choose(floats, none, motor->emf_constant);
    step->torque_constant = choose(floats, none, motor->torque_constant);
    step->torque_per_volt = choose(floats, none, motor->torque_per_volt);
    const real_t ramp = (settled->a_phi_3 + stiffness * (1 - settled->a_phi_3)) / motor->resistance;
    step->mean_ramp = choose(floats, none, ramp);
}

/* The mean current over the step for a constant speed. The caller adds the part that the change of speed causes. */
static inline real_t motor_mean_current(const motor_step_t *step, real_t voltage, real_t speed, real_t current)
{
    return step->mean_decay * current + step->mean_gain * (voltage - step->emf_constant * speed);
}

/* The drag on the change of speed within the step, N m s/rad: torque = ... - motor_damping * dw. */
static inline real_t motor_damping(const motor_step_t *step)
{
    return step->torque_constant * step->emf_constant * step->mean_ramp;
}

/* The current at the end of the step. */
static inline real_t motor_end_current(const motor_step_t *step, real_t voltage, real_t speed, real_t change,
                                       real_t current)
{
    return step->decay * current + step->gain * (voltage - step->emf_constant * speed) -
           step->mean_gain * step->emf_constant * change;
}

#endif
