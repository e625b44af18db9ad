#include "estimator/pose.h"

#include "core/fix.h"
#include "core/trig.h"

static uint16_t middle_bam16(uint16_t before_bam16, uint16_t after_bam16)
{
    const int16_t turned = fix_angle_diff_bam16(after_bam16, before_bam16);
    return (uint16_t)(before_bam16 + (uint16_t)((turned + (turned < 0 ? 1 : 0)) >> 1));
}

/* Returns the rest, below 1 um. */
static int16_t move_axis(int32_t travel_um_q5, int32_t *whole_um)
{
    const int32_t whole = fix_fraction(travel_um_q5, 5);
    fix_add_to(whole, whole_um);
    return (int16_t)((uint16_t)travel_um_q5 - (uint16_t)((uint16_t)whole << 5));
}

void pose_step(pose_state_t *state, signals_state_t *signals)
{
    const uint16_t along_bam16 = middle_bam16(state->heading_bam16, signals->heading_bam16);
    const int16_t cos_q15 = trig_cos_q15(along_bam16);
    const int16_t sin_q15 = trig_sin_q15(along_bam16);
    state->x_rest_um_q5 = move_axis(state->x_rest_um_q5 + fix_share_q15(signals->travel_um_q5, cos_q15) -
                                        (SIGNALS_SWAY ? fix_share_q15(signals->sway_travel_um_q5, sin_q15) : 0),
                                    &signals->x_um);
    state->y_rest_um_q5 = move_axis(state->y_rest_um_q5 + fix_share_q15(signals->travel_um_q5, sin_q15) +
                                        (SIGNALS_SWAY ? fix_share_q15(signals->sway_travel_um_q5, cos_q15) : 0),
                                    &signals->y_um);
    if (SIGNALS_HAVE(signals, SENSOR_REFERENCE)) {
        signals->x_um = signals->sensors.reference_x_um;
        signals->y_um = signals->sensors.reference_y_um;
        state->x_rest_um_q5 = 0;
        state->y_rest_um_q5 = 0;
    }
    state->heading_bam16 = signals->heading_bam16;
}
