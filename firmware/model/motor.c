#include "model/motor.h"

#include "core/fix.h"

enum { SPEED_LIMIT_MRAD_S_Q_3 = MOTOR_SPEED_LIMIT_MRAD_S_Q13 / 65536 };

#ifndef FIX_IN_ASSEMBLY
int32_t motor_row(const motor_row_t *row, const motor_state_t *state, int16_t voltage_mv)
{
    return scale_apply(&row->from_current, state->current_ua_q7) +
           scale_apply(&row->from_speed, state->speed_mrad_s_q13) + scale_apply16(&row->from_voltage, voltage_mv);
}
#endif

void motor_step(const motor_coefficients_t *coefficients, motor_state_t *state, int16_t voltage_mv,
                int32_t load_mrad_s_q13)
{
    const int32_t change = motor_row(&coefficients->speed, state, voltage_mv) + load_mrad_s_q13;

    state->current_ua_q7 = motor_row(&coefficients->current, state, voltage_mv);
    state->speed_mrad_s_q13 = fix_clamp_q16(state->speed_mrad_s_q13 + change, SPEED_LIMIT_MRAD_S_Q_3);
}
