#include "app/telemetry.h"

#include "core/fix.h"
#include "wire/codecs_gen.h"

enum { TICK_AT = WIRE_TELEMETRY_X_TICK_MS_AT, LAST = MESSAGE_DATA_MAX - 1 }; /* byte indices, the same in each part */

/* Puts a number into the message, low byte first, and returns the address after it. */
static uint8_t *put16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
    return at + 2;
}

/* Puts the three numbers of a part into bytes 0 to 5. */
static void put_three(uint8_t *data, int16_t first, int16_t second, int16_t third)
{
    (void)put16(put16(put16(data, (uint16_t)first), (uint16_t)second), (uint16_t)third);
}

/* Takes the number by address: a 32-bit argument makes more code, and the RCX has hardly any memory left. */
static uint8_t *put32(uint8_t *at, const int32_t *value)
{
    return put16(put16(at, (uint16_t)*value), (uint16_t)((uint32_t)*value >> 16));
}

static void put_pid(uint8_t *data, const pid_output_t *output)
{
    put_three(data, output->proportional_mv, output->integral_mv, output->derivative_mv);
}

static uint8_t sat_u8(uint16_t value)
{
    return value >> 8 != 0 ? (uint8_t)255 : (uint8_t)value;
}

static uint8_t track_flags(const mode_state_t *mode, const signals_estimate_t *estimate)
{
    uint8_t flags = (uint8_t)(mode->los.phase << WIRE_TELEMETRY_TRACK_PHASE_SHIFT);

    flags |= mode->mode;
    if (estimate->at_rest)
        flags |= 1U << WIRE_TELEMETRY_TRACK_AT_REST_SHIFT;
    if (estimate->valid)
        flags |= 1U << WIRE_TELEMETRY_TRACK_VALID_SHIFT;
    if (estimate->bias_unknown)
        flags |= 1U << WIRE_TELEMETRY_TRACK_BIAS_UNKNOWN_SHIFT;
    return flags;
}

/* Packs the fault and the two saturation flags. Each flag is -1, 0 or 1 and takes two bits. */
static uint8_t demand_flags(mode_fault_t fault, const signals_drive_t *drive)
{
    uint8_t flags = (uint8_t)drive->yaw_saturated;

    flags =
        (uint8_t)(flags << (WIRE_TELEMETRY_DEMAND_YAW_SATURATED_SHIFT - WIRE_TELEMETRY_DEMAND_SURGE_SATURATED_SHIFT));
    flags |= (uint8_t)drive->surge_saturated & WIRE_TELEMETRY_DEMAND_SURGE_SATURATED_MASK;
    flags = (uint8_t)(flags << WIRE_TELEMETRY_DEMAND_SURGE_SATURATED_SHIFT);
    return flags | fault;
}

/* Sets id and size of the message. Returns the address of its data. */
static uint8_t *begin(message_t *message, uint16_t id)
{
    message->id = id;
    message->size = MESSAGE_DATA_MAX;
    return message->data;
}

void telemetry_part(telemetry_part_t part, const loop_state_t *state, message_t *message)
{
    uint8_t *const data = begin(message, (uint16_t)(WIRE_TELEMETRY_X_FRAME_ID + part)); /* part ids are in order */

    data[TICK_AT] = (uint8_t)state->clock_ms;
    data[LAST] = 0;
    if (part == TELEMETRY_X) {
        put16(put32(data, &state->output.estimate.x_um), state->output.estimate.heading_bam16);
        data[LAST] = state->step.mode.los.waypoint;
    } else if (part == TELEMETRY_Y) {
        put16(put32(data, &state->output.estimate.y_um), (uint16_t)state->output.estimate.speed_mm_s_q4);
        data[LAST] = sat_u8(state->step.mode.los.overshoots);
    } else if (part == TELEMETRY_TRACK) {
        put_three(data, state->output.estimate.yaw_rate_mrad_s, state->step.mode.los.cross_track_mm,
                  state->step.mode.los.heading_error_bam16);
        data[LAST] = track_flags(&state->step.mode, &state->output.estimate);
    } else if (part == TELEMETRY_DEMAND) {
        put_three(data, state->output.demand.speed_mm_s_q4, (int16_t)state->output.demand.heading_bam16,
                  (int16_t)state->step.mixer.battery_mv);
        data[LAST] = demand_flags(state->step.mode.fault, &state->output.drive);
    } else if (part == TELEMETRY_SPEED) {
        put_pid(data, &state->output.speed_pid);
    } else if (part == TELEMETRY_HEADING) {
        put_pid(data, &state->output.heading_pid);
    } else {
        put_three(data, state->output.effort.surge_mv, state->output.effort.yaw_mv,
                  (int16_t)state->step.heading.full_steps);
    }
}

void telemetry_heartbeat(const loop_state_t *state, message_t *message)
{
    const mode_state_t *const mode = &state->step.mode;
    uint8_t *const data = begin(message, WIRE_HEARTBEAT_FRAME_ID);

    (void)put16(put32(data, (const int32_t *)&state->tick), state->late_ticks);
    data[WIRE_HEARTBEAT_MODE_AT] = (uint8_t)(mode->fault << WIRE_HEARTBEAT_FAULT_SHIFT) | mode->mode;
    data[WIRE_HEARTBEAT_ABORTED_AT] = sat_u8(state->aborted);
}

#ifndef MONITOR_OFF
void telemetry_monitor(uint8_t channel, const loop_state_t *state, message_t *message)
{
    const monitor_report_t *const report = &state->step.monitor.report[channel];
    uint8_t *const data = begin(message, (uint16_t)(WIRE_MONITOR_LEFT_FRAME_ID + channel)); /* ids are in order */

    (void)put32(put16(data, (uint16_t)report->size), (const int32_t *)&report->since_ms);
    data[TICK_AT] = (uint8_t)state->clock_ms;
    data[LAST] = report->cause;
}
#endif
