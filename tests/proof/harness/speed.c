#include "abstract.h"
#define fix_mul_q15 open_share_q15
#include "estimator/friction.c"
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

/* For any model, readings and settings, friction keeps its limit, and takes at most this limit from the motors. At rest
 * it leaves a voltage of the same sign or none: it cannot drive the model. */
void friction_bounded(void)
{
    parameters_t parameters;
    friction_state_t state;
    friction_input_t input;
    int16_t friction, surge_mv, taken_mv, speed_mm_s_q4, yaw_rate_mrad_s;

    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config));
    ASSUME(friction_holds(&state) && WITHIN(friction_input_t_period_ms, input.period_ms));
    (void)friction_step(&parameters.config.step.speed.friction, &state, &input);
    friction_take_motion(&parameters.config.step.speed.friction, &state, speed_mm_s_q4, yaw_rate_mrad_s);
    ASSERT(friction_holds(&state));
    friction = friction_mv(&parameters.config.step.speed.friction, &state);
    ASSERT(friction >= 0 && friction <= FRICTION_MOST_MV);
    taken_mv = friction_takes_mv(&parameters.config.step.speed.friction, &state, speed_mm_s_q4, surge_mv);
    ASSERT(UP_TO(FRICTION_MOST_MV, taken_mv));
    if (state.motion == FRICTION_STILL)
        ASSERT(surge_mv >= 0 ? taken_mv >= 0 && taken_mv <= surge_mv : taken_mv <= 0 && taken_mv >= surge_mv);
    END();
}
