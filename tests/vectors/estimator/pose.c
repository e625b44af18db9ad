#include "estimator/pose.h"

#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 32 };

#define TRAVEL_LIMIT_UM_Q5 67108864L

void vectors_feed(void)
{
    static pose_state_t state;
    static signals_sensors_t sensors;
    static uint8_t left;
    pose_input_t input;
    pose_output_t output;

    if (left == 0) {
        left = RUN_STEPS;
        state.x_um = draw_s32();
        state.y_um = draw_s32();
        state.x_rest_um_q5 = draw_between(-31, 31);
        state.y_rest_um_q5 = draw_between(-31, 31);
        state.heading_bam16 = (uint16_t)draw_s16();
    }
    left--;
    input.sensors = &sensors;
    draw_sensors(&sensors);
    if (!draw_rarely(3))
        sensors.have &= (uint8_t)~SENSOR_REFERENCE;
    input.travel_um_q5 = draw_within(TRAVEL_LIMIT_UM_Q5);
    input.sway_travel_um_q5 = draw_rarely(1) ? draw_within(TRAVEL_LIMIT_UM_Q5) : 0;
    input.heading_bam16 = (uint16_t)(state.heading_bam16 + (uint16_t)draw_s16());
    pose_step(&state, &input, &output);
    hash_s32(output.x_um);
    hash_s32(output.y_um);
    hash_s16(state.x_rest_um_q5);
    hash_s16(state.y_rest_um_q5);
    hash_u16(state.heading_bam16);
}
