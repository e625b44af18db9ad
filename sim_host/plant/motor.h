/* motor.h: eq. 12, exact over a motor step in which the wheel speed changes linearly.
 *
 * With a = h R / L and phi_1 = (1 - e^-a) / a, phi_2 = (1 - phi_1) / a, phi_3 = (1/2 - phi_2) / a:
 *   i(h)   = e^-a i + (1 - e^-a) / R e - (1 - phi_1) / R K_e dw
 *   mean i = phi_1 i + (1 - phi_1) / R e - (1/2 - phi_2) / R K_e dw          e = V - K_e w, dw = the change of w
 * and i = (V - K_e w) / R for L -> 0. This is an integrating factor: Hochbruck & Ostermann 2010. Where a step does not
 * resolve the motion (`stiffness` near 1), the last factor goes from 1/2 - phi_2 to 1, which damps instead of ringing.
 * The stiffness is of second order in h, so the method stays of order 2.
 */
#ifndef BRICKPILOT_PLANT_MOTOR_H
#define BRICKPILOT_PLANT_MOTOR_H

#include <stdbool.h>

#include "effects/vehicle.h"

typedef struct {
    double emf_constant;
    double torque_constant;
    double torque_per_volt;
    double decay;      /* e^-a */
    double gain;       /* (1 - e^-a) / R */
    double mean_decay; /* phi_1 */
    double mean_gain;  /* (1 - phi_1) / R */
    double mean_ramp;  /* (1/2 - phi_2) / R, more where the step is stiff */

    /* What the coefficients above were computed for, but mean_ramp; and a phi_3 with it. */
    double of_step, of_resistance, of_inductance;
    double a_phi_3;
} motor_step_t;

/* Fills the coefficients for motor steps of h seconds; stiffness 0..1. A motor that floats carries no current. `step` is
 * all zero, or was prepared before: what depends on step, resistance and inductance alone is computed when one of them
 * has changed. */
void motor_prepare(motor_step_t *step, const motor_t *motor, double h, bool floats, double stiffness);

/* The mean current over the step for a constant speed. The caller adds the part that the change of speed makes. */
static inline double motor_mean_current(const motor_step_t *step, double voltage, double speed, double current)
{
    return step->mean_decay * current + step->mean_gain * (voltage - step->emf_constant * speed);
}

/* The drag on the change of speed within the step, N m s/rad: torque = ... - motor_damping * dw. */
static inline double motor_damping(const motor_step_t *step)
{
    return step->torque_constant * step->emf_constant * step->mean_ramp;
}

/* The current at the end of the step. */
static inline double motor_end_current(const motor_step_t *step, double voltage, double speed, double change,
                                       double current)
{
    return step->decay * current + step->gain * (voltage - step->emf_constant * speed) -
           step->mean_gain * step->emf_constant * change;
}

#endif
