#include "contracts.h"
#include "estimator/heading.c"

void heading_safe(void)
{
    parameters_t parameters;
    heading_state_t state;
    signals_sensors_t sensors;
    signals_predicted_t predicted;
    signals_estimate_t estimate;

    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config));
    ASSUME(sensors_hold(&sensors) && heading_holds(&state));
    heading_step(&parameters.config.step.heading, &state, &sensors, &predicted, &estimate);
    ASSERT(heading_holds(&state));
    ASSERT(estimate.at_rest == state.at_rest);
    END();
}
