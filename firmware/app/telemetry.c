#include "app/telemetry.h"

#include "wire/codecs_gen.h"

static uint8_t sat_u8(uint16_t value)
{
    return value > 255U ? (uint8_t)255 : (uint8_t)value;
}

static void pack_x(uint8_t tick_ms, const step_state_t *state, const step_output_t *output, uint8_t *data)
{
    struct wire_telemetry_x_t x;
    x.x = output->state.x_um;
    x.heading = (int16_t)output->state.heading_bam16;
    x.tick_ms = tick_ms;
    x.waypoint = state->mode.los.waypoint;
    (void)wire_telemetry_x_pack(data, &x, MESSAGE_DATA_MAX);
}

static void pack_y(uint8_t tick_ms, const step_state_t *state, const step_output_t *output, uint8_t *data)
{
    struct wire_telemetry_y_t y;
    y.y = output->state.y_um;
    y.speed = output->state.speed_mm_s_q4;
    y.tick_ms = tick_ms;
    y.overshoots = sat_u8(state->mode.los.overshoots);
    (void)wire_telemetry_y_pack(data, &y, MESSAGE_DATA_MAX);
}

static void pack_track(uint8_t tick_ms, const step_state_t *state, const step_output_t *output, uint8_t *data)
{
    struct wire_telemetry_track_t track;
    track.yaw_rate = output->state.yaw_rate_mrad_s;
    track.cross_track = state->mode.los.cross_track_mm;
    track.heading_error = state->mode.los.heading_error_bam16;
    track.tick_ms = tick_ms;
    track.mode = (uint8_t)state->mode.mode;
    track.phase = (uint8_t)state->mode.los.phase;
    track.at_rest = output->state.at_rest ? 1 : 0;
    track.valid = output->state.valid ? 1 : 0;
    (void)wire_telemetry_track_pack(data, &track, MESSAGE_DATA_MAX);
}

static void pack_demand(uint8_t tick_ms, const step_state_t *state, uint8_t *data)
{
    struct wire_telemetry_demand_t demand;
    demand.speed = state->mode.demand.speed_mm_s_q4;
    demand.heading = (int16_t)state->mode.demand.heading_bam16;
    demand.battery = state->battery_mv;
    demand.tick_ms = tick_ms;
    demand.fault = (uint8_t)state->mode.fault;
    demand.surge_saturated = state->drive.surge_saturated;
    demand.yaw_saturated = state->drive.yaw_saturated;
    (void)wire_telemetry_demand_pack(data, &demand, MESSAGE_DATA_MAX);
}

static void pack_speed(uint8_t tick_ms, const pid_terms_t *pid, uint8_t *data)
{
    struct wire_telemetry_speed_t speed;
    speed.proportional = pid->proportional_mv;
    speed.integral = pid->integral_mv;
    speed.derivative = pid->derivative_mv;
    speed.tick_ms = tick_ms;
    (void)wire_telemetry_speed_pack(data, &speed, MESSAGE_DATA_MAX);
}

static void pack_heading(uint8_t tick_ms, const pid_terms_t *pid, uint8_t *data)
{
    struct wire_telemetry_heading_t heading;
    heading.proportional = pid->proportional_mv;
    heading.integral = pid->integral_mv;
    heading.derivative = pid->derivative_mv;
    heading.tick_ms = tick_ms;
    (void)wire_telemetry_heading_pack(data, &heading, MESSAGE_DATA_MAX);
}

static void pack_effort(uint8_t tick_ms, const signals_effort_t *efforts, uint8_t *data)
{
    struct wire_telemetry_effort_t effort;
    effort.surge = efforts->surge_mv;
    effort.yaw = efforts->yaw_mv;
    effort.tick_ms = tick_ms;
    (void)wire_telemetry_effort_pack(data, &effort, MESSAGE_DATA_MAX);
}

void telemetry_part(uint8_t part, uint8_t tick_ms, const step_state_t *state, const step_output_t *output,
                    message_t *message)
{
    message->id = (uint16_t)(WIRE_TELEMETRY_X_FRAME_ID + part);
    message->size = MESSAGE_DATA_MAX;
    if (part == 0)
        pack_x(tick_ms, state, output, message->data);
    else if (part == 1)
        pack_y(tick_ms, state, output, message->data);
    else if (part == 2)
        pack_track(tick_ms, state, output, message->data);
    else if (part == 3)
        pack_demand(tick_ms, state, message->data);
    else if (part == 4)
        pack_speed(tick_ms, &output->speed, message->data);
    else if (part == 5)
        pack_heading(tick_ms, &output->heading, message->data);
    else
        pack_effort(tick_ms, &output->effort, message->data);
}

void telemetry_heartbeat(uint32_t tick, uint16_t late_ticks, uint16_t aborted, const mode_state_t *mode,
                         message_t *message)
{
    struct wire_heartbeat_t heartbeat;
    heartbeat.tick = tick;
    heartbeat.late_ticks = late_ticks;
    heartbeat.mode = (uint8_t)mode->mode;
    heartbeat.fault = (uint8_t)mode->fault;
    heartbeat.aborted = sat_u8(aborted);
    message->id = WIRE_HEARTBEAT_FRAME_ID;
    message->size = WIRE_HEARTBEAT_LENGTH;
    (void)wire_heartbeat_pack(message->data, &heartbeat, MESSAGE_DATA_MAX);
}
