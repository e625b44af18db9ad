#include "model/motor.h"

#include "core/fix.h"

void motor_step(const motor_coefficients_t *coefficients, motor_state_t *state, int16_t voltage_mv,
                int32_t load_mrad_s_q13)
{
    const int32_t current = state->current_ua_q7;
    const int32_t speed = state->speed_mrad_s_q13;
    const int32_t change = scale_apply(&coefficients->speed_from_current, current) +
                           scale_apply(&coefficients->speed_from_speed, speed) +
                           scale_apply16(&coefficients->speed_from_voltage, voltage_mv) + load_mrad_s_q13;

    state->current_ua_q7 = scale_apply(&coefficients->current_from_current, current) +
                           scale_apply(&coefficients->current_from_speed, speed) +
                           scale_apply16(&coefficients->current_from_voltage, voltage_mv);
    state->speed_mrad_s_q13 = fix_clamp32(speed + change, MOTOR_SPEED_LIMIT_MRAD_S_Q13);
}
