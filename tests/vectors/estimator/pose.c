#include "estimator/pose.h"

#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 32 };

#define TRAVEL_LIMIT_UM_Q5 67108864L

void vectors_feed(void)
{
    static pose_state_t state;
    static signals_sensors_t sensors;
    static signals_estimate_t estimate;
    static uint8_t left;

    if (left == 0) {
        left = RUN_STEPS;
        state.x.um = draw_s32();
        state.y.um = draw_s32();
        state.x.rest_um_q5 = draw_between(-31, 31);
        state.y.rest_um_q5 = draw_between(-31, 31);
        state.heading_bam16 = (uint16_t)draw_s16();
    }
    left--;
    draw_sensors(&sensors);
    if (!draw_rarely(3))
        sensors.have &= (uint8_t)~SENSOR_REFERENCE;
    estimate.travel_um_q5 = draw_within(TRAVEL_LIMIT_UM_Q5);
    estimate.sway_travel_um_q5 = draw_rarely(1) ? draw_within(TRAVEL_LIMIT_UM_Q5) : 0;
    estimate.heading_bam16 = (uint16_t)(state.heading_bam16 + (uint16_t)draw_s16());
    pose_step(&state, &sensors, &estimate);
    hash_s32(estimate.x_um);
    hash_s32(estimate.y_um);
    hash_s16(state.x.rest_um_q5);
    hash_s16(state.y.rest_um_q5);
    hash_u16(state.heading_bam16);
}
