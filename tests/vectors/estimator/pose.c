#include "estimator/pose.h"

#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 32 };

#define TRAVEL_LIMIT_UM_Q5 67108864L

void vectors_feed(void)
{
    static pose_state_t state;
    static signals_state_t signals;
    static uint8_t left;

    if (left == 0) {
        left = RUN_STEPS;
        signals.x_um = draw_s32();
        signals.y_um = draw_s32();
        state.x_rest_um_q5 = draw_between(-31, 31);
        state.y_rest_um_q5 = draw_between(-31, 31);
        state.heading_bam16 = (uint16_t)draw_s16();
    }
    left--;
    draw_sensors(&signals.sensors);
    if (!draw_rarely(3))
        signals.sensors.have &= (uint8_t)~SENSOR_REFERENCE;
    signals.travel_um_q5 = draw_within(TRAVEL_LIMIT_UM_Q5);
    signals.sway_travel_um_q5 = draw_rarely(1) ? draw_within(TRAVEL_LIMIT_UM_Q5) : 0;
    signals.heading_bam16 = (uint16_t)(state.heading_bam16 + (uint16_t)draw_s16());
    pose_step(&state, &signals);
    hash_s32(signals.x_um);
    hash_s32(signals.y_um);
    hash_s16(state.x_rest_um_q5);
    hash_s16(state.y_rest_um_q5);
    hash_u16(state.heading_bam16);
}
