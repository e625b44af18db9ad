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
enum { NONE = 255 };

enum { Y = 1, TRACK = 2, DEMAND = 3 };

/* Of the parts, and of the heartbeat. */
static const uint8_t PLACES[TELEMETRY_PARTS + 1][MESSAGE_DATA_MAX] = {
    {FOUR(output.state.x_um), TWO(output.state.heading_bam16), TICK, ONE(step.mode.los.waypoint)},
    {FOUR(output.state.y_um), TWO(output.state.speed_mm_s_q4), TICK, NONE},
    {TWO(output.state.yaw_rate_mrad_s), TWO(step.mode.los.cross_track_mm), TWO(step.mode.los.heading_error_bam16), TICK,
     ONE(step.mode.mode)},
    {TWO(step.mode.los.demand.speed_mm_s_q4), TWO(step.mode.los.demand.heading_bam16), TWO(step.mixer.battery_mv), TICK,
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

/* What of the last byte is not in the table. */
static uint8_t last_of(uint8_t part, const loop_state_t *state)
{
    const mode_state_t *const mode = &state->step.mode;
    const signals_drive_t *const drive = &state->step.mixer.drive;

    if (part == TELEMETRY_HEARTBEAT)
        return sat_u8(fix_add_u16(state->aborted_late, state->aborted_silent));
    if (part == Y)
        return sat_u8(mode->los.overshoots);
    if (part == TRACK)
        return (uint8_t)(mode->los.phase << WIRE_TELEMETRY_TRACK_PHASE_SHIFT |
                         state->output.state.at_rest << WIRE_TELEMETRY_TRACK_AT_REST_SHIFT |
                         state->output.state.valid << WIRE_TELEMETRY_TRACK_VALID_SHIFT);
    if (part == DEMAND)
        return (uint8_t)(((uint8_t)drive->surge_saturated & WIRE_TELEMETRY_DEMAND_SURGE_SATURATED_MASK)
                             << WIRE_TELEMETRY_DEMAND_SURGE_SATURATED_SHIFT |
                         (unsigned)(uint8_t)drive->yaw_saturated << WIRE_TELEMETRY_DEMAND_YAW_SATURATED_SHIFT);
    return 0;
}

void telemetry_part(uint8_t part, const loop_state_t *state, message_t *message)
{
    const mode_state_t *const mode = &state->step.mode;
    const uint8_t *place = PLACES[part];
    uint8_t *to = message->data;
    uint8_t left = MESSAGE_DATA_MAX;

    message->id = (uint16_t)(WIRE_TELEMETRY_X_FRAME_ID + part);
    message->size = MESSAGE_DATA_MAX;
    do {
        const uint8_t at = *place++;
        *to = 0;
        if (at != NONE)
            *to = ((const uint8_t *)mode)[at];
        to++;
    } while (--left > 0);
    to[-1] |= last_of(part, state);
    if (part == TELEMETRY_HEARTBEAT) {
        message->id = WIRE_HEARTBEAT_FRAME_ID;
        to[-2] |= (uint8_t)(mode->fault << WIRE_HEARTBEAT_FAULT_SHIFT);
    }
}
