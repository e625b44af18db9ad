#include "app/telemetry.h"

#include <stddef.h>

#include "core/fix.h"
#include "wire/codecs_gen.h"

/* Where in the state a byte of a message comes from: from its mode_state_t on, behind which lies all that telemetry tells. A field's bytes
 * go from the lowest on. NONE is 0. */
#define PLACE(field, n)                                                                                                \
    (offsetof(loop_state_t, field) - offsetof(loop_state_t, step.mode) + (n)*MESSAGE_UP +                              \
     MESSAGE_LOWEST(sizeof(((const loop_state_t *)0)->field)))
#define ONE(field) PLACE(field, 0)
#define TWO(field) ONE(field), PLACE(field, 1)
#define FOUR(field) TWO(field), PLACE(field, 2), PLACE(field, 3)
#define TICK ONE(clock_ms)
enum { NONE = 255, LAST = MESSAGE_DATA_MAX - 1 };

enum { Y = 1, TRACK = 2, DEMAND = 3 };

/* Of the parts, and of the heartbeat. */
static const uint8_t PLACES[TELEMETRY_PARTS + 1][MESSAGE_DATA_MAX] = {
    {FOUR(output.state.x_um), TWO(output.state.heading_bam16), TICK, ONE(step.mode.guidance.waypoint)},
    {FOUR(output.state.y_um), TWO(output.state.speed_mm_s_q4), TICK, NONE},
    {TWO(output.state.yaw_rate_mrad_s), TWO(step.mode.guidance.cross_track_mm),
     TWO(step.mode.guidance.heading_error_bam16), TICK, ONE(step.mode.mode)},
    {TWO(step.mode.demand.speed_mm_s_q4), TWO(step.mode.demand.heading_bam16), TWO(step.battery_mv), TICK,
     ONE(step.mode.fault)},
    {TWO(output.speed.proportional_mv), TWO(output.speed.integral_mv), TWO(output.speed.derivative_mv), TICK, NONE},
    {TWO(output.heading.proportional_mv), TWO(output.heading.integral_mv), TWO(output.heading.derivative_mv), TICK,
     NONE},
    {TWO(output.effort.surge_mv), TWO(output.effort.yaw_mv), NONE, NONE, TICK, NONE},
    {FOUR(tick), TWO(late_ticks), ONE(step.mode.mode), NONE},
};

static uint8_t sat_u8(uint16_t value)
{
    return value > 255U ? (uint8_t)255 : (uint8_t)value;
}

/* What shares a byte with other signals. */
static uint8_t of_track(const loop_state_t *state)
{
    return (uint8_t)(state->step.mode.guidance.phase << WIRE_TELEMETRY_TRACK_PHASE_SHIFT |
                     state->output.state.at_rest << WIRE_TELEMETRY_TRACK_AT_REST_SHIFT |
                     state->output.state.valid << WIRE_TELEMETRY_TRACK_VALID_SHIFT);
}

static uint8_t of_demand(const signals_drive_t *drive)
{
    const uint8_t surge = (uint8_t)drive->surge_saturated & WIRE_TELEMETRY_DEMAND_SURGE_SATURATED_MASK;
    const uint8_t yaw = (uint8_t)drive->yaw_saturated;

    return (uint8_t)(surge << WIRE_TELEMETRY_DEMAND_SURGE_SATURATED_SHIFT |
                     yaw << WIRE_TELEMETRY_DEMAND_YAW_SATURATED_SHIFT);
}

void telemetry_part(uint8_t part, const loop_state_t *state, message_t *message)
{
    const mode_state_t *const mode = &state->step.mode;
    const uint8_t *place = PLACES[part];
    uint8_t *to = message->data;

    message->id = (uint16_t)(WIRE_TELEMETRY_X_FRAME_ID + part);
    message->size = MESSAGE_DATA_MAX;
    for (uint8_t left = MESSAGE_DATA_MAX; left > 0; left--) {
        const uint8_t at = *place++;
        *to++ = at == NONE ? 0 : ((const uint8_t *)mode)[at];
    }
    to--;
    if (part == Y) {
        *to = sat_u8(mode->guidance.overshoots);
    } else if (part == TRACK) {
        *to |= of_track(state);
    } else if (part == DEMAND) {
        *to |= of_demand(&state->step.drive);
    } else if (part == TELEMETRY_HEARTBEAT) {
        message->id = WIRE_HEARTBEAT_FRAME_ID;
        *to = sat_u8(fix_add_u16(state->aborted_late, state->aborted_silent));
        *--to |= (uint8_t)(mode->fault << WIRE_HEARTBEAT_FAULT_SHIFT);
    }
}
