#include "estimator/pose.h"

#include "core/fix.h"
#include "core/trig.h"

#ifdef FIX_IN_ASSEMBLY
#include "estimator/pose_h8.h"
#else
static uint16_t middle_bam16(uint16_t before_bam16, uint16_t after_bam16)
{
    const int16_t turned = fix_angle_diff_bam16(after_bam16, before_bam16);
    return (uint16_t)(before_bam16 + (uint16_t)((turned + (turned < 0 ? 1 : 0)) >> 1));
}

/* By the travel's share along an axis and sway's across it. */
static void move_axis(int32_t *whole_um, int16_t *rest_um_q5, const signals_state_t *signals, int16_t along_q15,
                      int16_t across_q15)
{
    const int32_t sum = *rest_um_q5 + fix_share_q15(signals->travel_um_q5, along_q15) +
                        (SIGNALS_SWAY ? fix_share_q15(signals->sway_travel_um_q5, across_q15) : 0);
    const int32_t whole = fix_fraction(sum, 5);
    fix_add_to(whole, whole_um);
    *rest_um_q5 = (int16_t)((uint16_t)sum - (uint16_t)((uint16_t)whole << 5));
}

void pose_step(pose_state_t *state, signals_state_t *signals)
{
    const uint16_t along_bam16 = middle_bam16(state->heading_bam16, signals->heading_bam16);
    const int16_t cos_q15 = trig_cos_q15(along_bam16);
    const int16_t sin_q15 = trig_sin_q15(along_bam16);
    move_axis(&signals->x_um, &state->x_rest_um_q5, signals, cos_q15, (int16_t)-sin_q15);
    move_axis(&signals->y_um, &state->y_rest_um_q5, signals, sin_q15, cos_q15);
    if (SIGNALS_HAVE(signals, SENSOR_REFERENCE)) {
        signals->x_um = signals->sensors.reference_x_um;
        signals->y_um = signals->sensors.reference_y_um;
        state->x_rest_um_q5 = 0;
        state->y_rest_um_q5 = 0;
    }
    state->heading_bam16 = signals->heading_bam16;
}
#endif
