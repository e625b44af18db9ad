#include "estimator/pose.h"

#include "core/fix.h"
#include "core/trig.h"

static uint16_t middle_bam16(uint16_t before_bam16, uint16_t after_bam16)
{
    const int16_t turned = fix_angle_diff_bam16(after_bam16, before_bam16);
    return (uint16_t)(before_bam16 + (uint16_t)((turned + (turned < 0 ? 1 : 0)) >> 1));
}

/* Moves along an axis by the components of forward and sway travel on this axis. Returns the new coordinate, um. */
static int32_t move_axis(pose_axis_t *axis, const signals_estimate_t *estimate, int16_t along_q15, int16_t across_q15)
{
    const int32_t sum = axis->rest_um_q5 + fix_mul_q15(estimate->travel_um_q5, along_q15) +
                        (SIGNALS_SWAY ? fix_mul_q15(estimate->sway_travel_um_q5, across_q15) : 0);
    const int32_t whole = fix_trunc_shift(sum, 5);
    axis->rest_um_q5 = (int16_t)((uint16_t)sum - (uint16_t)((uint16_t)whole << 5));
    axis->um = fix_add32(axis->um, whole);
    return axis->um;
}

void pose_step(pose_state_t *state, const signals_sensors_t *sensors, signals_estimate_t *estimate)
{
    const uint16_t along_bam16 = middle_bam16(state->heading_bam16, estimate->heading_bam16);
    const int16_t cos_q15 = trig_cos_q15(along_bam16);
    const int16_t sin_q15 = trig_sin_q15(along_bam16);
    estimate->x_um = move_axis(&state->x, estimate, cos_q15, (int16_t)-sin_q15);
    estimate->y_um = move_axis(&state->y, estimate, sin_q15, cos_q15);
    if (SIGNALS_HAVE(sensors, SENSOR_REFERENCE)) {
        estimate->x_um = state->x.um = sensors->reference_x_um;
        estimate->y_um = state->y.um = sensors->reference_y_um;
        state->x.rest_um_q5 = 0;
        state->y.rest_um_q5 = 0;
    }
    state->heading_bam16 = estimate->heading_bam16;
}
