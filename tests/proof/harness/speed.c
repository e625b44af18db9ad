#include "abstract.h"
#define fix_mul_q15 open_share_q15
#include "estimator/speed.c"

void speed_safe(void)
{
    parameters_t parameters;
    speed_state_t state;
    signals_sensors_t sensors;
    signals_predicted_t predicted;
    signals_estimate_t estimate;

    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config));
    ASSUME(sensors_hold(&sensors) && speed_holds(&state));
    estimate.period_ms = sensors.period_ms;
    (void)speed_step(&parameters.config.step.speed, &state, &sensors, &predicted, &estimate);
    ASSERT(speed_holds(&state));
    ASSERT(estimate_holds(&estimate));
    END();
}
