#include "model/motor.h"

#include "core/fix.h"

#ifndef FIX_IN_ASSEMBLY
static int32_t sum(const motor_row_t *row, const motor_state_t *state, int16_t voltage_mv)
{
    return scale_apply(&row->from_current, state->current_ua_q7) +
           scale_apply(&row->from_speed, state->speed_mrad_s_q13) + scale_apply16(&row->from_voltage, voltage_mv);
}

void motor_step(const motor_coefficients_t *coefficients, motor_state_t *state, int16_t voltage_mv,
                int32_t load_mrad_s_q13)
{
    const int32_t change = sum(&coefficients->speed, state, voltage_mv) + load_mrad_s_q13;

    state->current_ua_q7 = sum(&coefficients->current, state, voltage_mv);
    state->speed_mrad_s_q13 = fix_clamp32(state->speed_mrad_s_q13 + change, MOTOR_SPEED_LIMIT_MRAD_S_Q13);
}
#endif
