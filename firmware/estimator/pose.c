#include "estimator/pose.h"

#include "core/fix.h"
#include "core/trig.h"

static uint16_t middle_bam16(uint16_t before_bam16, uint16_t after_bam16)
{
    const int16_t turned = fix_angle_diff_bam16(after_bam16, before_bam16);
    const uint16_t half = (uint16_t)(fix_abs_u16(turned) >> 1);
    return (uint16_t)(turned < 0 ? before_bam16 - half : before_bam16 + half);
}

static void move_axis(int32_t *whole_um, int16_t *rest_um_q5, int32_t travel_um_q5)
{
    const int32_t sum = travel_um_q5 + *rest_um_q5;
    const uint32_t magnitude = fix_abs_u32(sum);
    const int32_t whole = (int32_t)(magnitude >> 5);
    const int16_t rest = (int16_t)(magnitude & 31U);
    *whole_um = fix_add32(*whole_um, sum < 0 ? -whole : whole);
    *rest_um_q5 = sum < 0 ? (int16_t)-rest : rest;
}

void pose_step(pose_state_t *state, const pose_input_t *input, pose_output_t *output)
{
    const uint16_t along_bam16 = middle_bam16(state->heading_bam16, input->heading_bam16);
    const int16_t cos_q15 = trig_cos_q15(along_bam16);
    const int16_t sin_q15 = trig_sin_q15(along_bam16);
    move_axis(&state->x_um, &state->x_rest_um_q5,
              fix_share_q15(input->travel_um_q5, cos_q15) - fix_share_q15(input->sway_travel_um_q5, sin_q15));
    move_axis(&state->y_um, &state->y_rest_um_q5,
              fix_share_q15(input->travel_um_q5, sin_q15) + fix_share_q15(input->sway_travel_um_q5, cos_q15));
    if (SIGNALS_HAVE(input->sensors, SENSOR_REFERENCE)) {
        state->x_um = input->sensors->reference_x_um;
        state->y_um = input->sensors->reference_y_um;
        state->x_rest_um_q5 = 0;
        state->y_rest_um_q5 = 0;
    }
    state->heading_bam16 = input->heading_bam16;
    output->x_um = state->x_um;
    output->y_um = state->y_um;
}
