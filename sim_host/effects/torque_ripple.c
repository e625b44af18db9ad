#include "effects/effect.h"

#include <math.h>

static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const bp_state *state = &vehicle->state;
    const int count = vehicle->vehicle == BP_MOTOR ? 1 : 2;
    for (int k = 0; k < count; k++) {
        const motor_t *motor = &vehicle->motor[k];
        const double volts = isnan(vehicle->voltage[k]) ? 0 : vehicle->voltage[k];
        const double torque = motor->torque_constant * state->current[k] + motor->torque_per_volt * volts;
        const double middle = state->wheel_angle[k] + 0.5 * vehicle->step * state->wheel_speed[k];
        const double phase = value[2] + (k == 0 ? 0.5 : -0.5) * value[3];
        vehicle->wheel_torque[k] += value[0] * torque * sin(value[1] * middle + phase);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {"amplitude", "1", "over the motor's torque", 0, 1, 0.3, 0},
    {"order", "1", "periods per turn of the wheel; rad/m where the motor's input commands force", 0, 10000, 6, 0},
    {"phase", "rad", "at wheel angle 0, mean of left and right", -6.3, 6.3, 0, 0},
    {"phase_difference", "rad", "left less right; nothing on a single motor", -6.3, 6.3, 0, 1},
};

const effect_t effect_torque_ripple = {
    .info = {.name = "torque_ripple",
             .acts_on = "gear",
             .equation = "T = K_t i (1 + amplitude sin(order angle + phase)), left phase + phase_difference / 2, right "
                         "phase - phase_difference / 2",
             .source = "Jahns & Soong 1996, Pulsating torque minimization techniques for permanent magnet AC motor "
                       "drives, one harmonic",
             .parameter_count = 4,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
