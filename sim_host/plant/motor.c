#include "plant/motor.h"

#include <math.h>

/* 1 - a phi_1 = e^-a, 1 - a phi_2 = phi_1, 1/2 - a phi_3 = phi_2: kept as products with a, which stay finite as L -> 0.
 */
typedef struct {
    double phi_1, phi_2;
    double a_phi_1, a_phi_2, a_phi_3;
} phi_t;

static const phi_t QUASI_STATIC = {.a_phi_1 = 1, .a_phi_2 = 1, .a_phi_3 = 0.5};

/* For small a the closed forms lose digits. There phi_3 is summed from its series, and the others follow from it. */
static phi_t phi_functions(double a)
{
    phi_t phi;
    if (a < 0.5) {
        double series = 0;
        for (int n = 16; n >= 0; n--)
            series = (1 - a * series) / (n + 3);
        phi.a_phi_3 = 0.5 * a * series;
        phi.phi_2 = 0.5 - phi.a_phi_3;
        phi.a_phi_2 = a * phi.phi_2;
        phi.phi_1 = 1 - phi.a_phi_2;
        phi.a_phi_1 = a * phi.phi_1;
    } else {
        phi.a_phi_1 = 1 - exp(-a);
        phi.phi_1 = phi.a_phi_1 / a;
        phi.a_phi_2 = 1 - phi.phi_1;
        phi.phi_2 = phi.a_phi_2 / a;
        phi.a_phi_3 = 0.5 - phi.phi_2;
    }
    return phi;
}

static void settle(motor_step_t *step, const motor_t *motor, double h)
{
    const double resistance = motor->resistance;
    const phi_t phi = motor->inductance > 0 ? phi_functions(h * resistance / motor->inductance) : QUASI_STATIC;

    step->decay = 1 - phi.a_phi_1;
    step->gain = phi.a_phi_1 / resistance;
    step->mean_decay = phi.phi_1;
    step->mean_gain = phi.a_phi_2 / resistance;
    step->a_phi_3 = phi.a_phi_3;
    step->of_step = h;
    step->of_resistance = resistance;
    step->of_inductance = motor->inductance;
}

void motor_prepare(motor_step_t *step, const motor_t *motor, double h, bool floats, double stiffness)
{
    if (floats) {
        *step = (motor_step_t){0};
        return;
    }
    if (step->of_step != h || step->of_resistance != motor->resistance || step->of_inductance != motor->inductance)
        settle(step, motor, h);
    step->emf_constant = motor->emf_constant;
    step->torque_constant = motor->torque_constant;
    step->torque_per_volt = motor->torque_per_volt;
    step->mean_ramp = (step->a_phi_3 + stiffness * (1 - step->a_phi_3)) / motor->resistance;
}
