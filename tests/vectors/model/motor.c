#include "model/motor.h"

#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 16 };

#define CURRENT_LIMIT_UA_Q7 2137600000L  /* 16.7 A */
#define LOAD_LIMIT_MRAD_S_Q13 163840000L /* 20 rad/s */

/* Sixteen steps from anywhere within the limits, with the coefficients of one and the other motor in turn. */
void vectors_feed(void)
{
    static motor_state_t state;
    static uint8_t left, motor;
    const int16_t voltage_mv = draw_s16();
    const int32_t load_mrad_s_q13 = draw_rarely(1) ? draw_within(LOAD_LIMIT_MRAD_S_Q13) : 0;

    if (left == 0) {
        left = RUN_STEPS;
        motor = (uint8_t)(1 - motor);
        state.current_ua_q7 = draw_within(CURRENT_LIMIT_UA_Q7);
        state.speed_mrad_s_q13 = draw_within(MOTOR_SPEED_LIMIT_MRAD_S_Q13);
    }
    left--;
    motor_step(&PARAMS.step.model->motor[motor], &state, voltage_mv, load_mrad_s_q13);
    hash_s32(state.current_ua_q7);
    hash_s32(state.speed_mrad_s_q13);
}
