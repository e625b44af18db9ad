#include "effects/effect.h"

#include <math.h>

static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const bp_state *state = &vehicle->state;
    const int count = vehicle->vehicle == BP_MOTOR ? 1 : 2;
    for (int k = 0; k < count; k++) {
        const double middle = state->wheel_angle[k] + 0.5 * vehicle->step * state->wheel_speed[k];
        const double phase = value[2] + (k == 0 ? 0.5 : -0.5) * value[3];
        vehicle->wheel_torque[k] -= value[0] * sin(value[1] * middle + phase);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {"torque", "N m", "largest, at each wheel; N where the motor's input commands force", 0, 1000, 0.02, 0},
    {"order", "1", "detents per turn of the wheel; rad/m where the motor's input commands force", 0, 10000, 6, 0},
    {"phase", "rad", "at wheel angle 0, mean of left and right; 0: it rests in a detent", -6.3, 6.3, 0, 0},
    {"phase_difference", "rad", "left less right; nothing on a single motor", -6.3, 6.3, 0, 1},
};

const effect_t effect_cogging = {
    .info = {.name = "cogging",
             .acts_on = "gear",
             .equation = "T_c = -torque sin(order angle + phase), left phase + phase_difference / 2, right phase - "
                         "phase_difference / 2",
             .source = "Jahns & Soong 1996, Pulsating torque minimization techniques for permanent magnet AC motor "
                       "drives, one harmonic",
             .parameter_count = 4,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
