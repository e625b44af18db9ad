#include "wire/codecs_gen.h"

#include "vectors.h"

enum { OF_VECTOR = 3, SIZE = 8 };

/* A message that the brick reads: its fields out of eight drawn bytes. */
#define READ(name, FIELDS)                                                                                             \
    static void name(uint8_t *data)                                                                                    \
    {                                                                                                                  \
        struct wire_##name##_t value;                                                                                  \
        for (uint8_t i = 0; i < SIZE; i++)                                                                             \
            data[i] = (uint8_t)draw_s16();                                                                             \
        hash_u8((uint8_t)wire_##name##_unpack(&value, data, SIZE));                                                    \
        FIELDS(HASH)                                                                                                   \
    }
#define HASH(bits, field) hash_u##bits((uint##bits##_t)value.field);

/* One that it writes: eight bytes out of drawn fields. */
#define WRITTEN(name, FIELDS)                                                                                          \
    static void name(uint8_t *data)                                                                                    \
    {                                                                                                                  \
        struct wire_##name##_t value;                                                                                  \
        FIELDS(DRAW)                                                                                                   \
        hash_u8((uint8_t)wire_##name##_pack(data, &value, SIZE));                                                      \
        for (uint8_t i = 0; i < SIZE; i++)                                                                             \
            hash_u8(data[i]);                                                                                          \
    }
#define DRAW(bits, field) value.field = DRAW_##bits;
#define DRAW_8 (uint8_t) draw_s16()
#define DRAW_16 (uint16_t) draw_s16()
#define DRAW_32 (uint32_t) draw_s32()

#define OPEN_FIELDS(X) X(8, sequence) X(8, protocol) X(16, dbc) X(8, profile) X(8, pace) X(16, check)
#define MODE_COMMAND_FIELDS(X) X(8, sequence) X(8, command) X(16, check)
#define IMU_FIELDS(X) X(16, accel_surge) X(16, accel_sway) X(16, yaw_rate) X(8, sequence) X(8, tick_ms)
#define ROTATION_FIELDS(X) X(16, left) X(16, right) X(8, sequence) X(8, tick_ms)
#define BATTERY_FIELDS(X) X(16, voltage) X(8, sequence) X(8, tick_ms)
#define REFERENCE_X_FIELDS(X) X(32, x) X(16, heading) X(8, sequence) X(8, tick_ms)
#define REFERENCE_Y_FIELDS(X) X(32, y) X(16, speed) X(8, sequence) X(8, tick_ms)
#define REFERENCE_TURN_FIELDS(X) X(16, yaw_rate) X(8, sequence) X(8, tick_ms)
#define SYNC_FIELDS(X) X(32, time) X(8, sequence) X(8, imu) X(8, rotation) X(8, battery) X(8, reference) X(16, check)
#define PARAMETER_REQUEST_FIELDS(X) X(8, sequence) X(8, parameter) X(8, write) X(32, value) X(16, check)
#define WAYPOINT_REQUEST_FIELDS(X) X(8, sequence) X(8, index) X(8, write) X(16, x) X(16, y) X(16, check)
#define ROUTE_REQUEST_FIELDS(X) X(8, sequence) X(8, count) X(8, write) X(16, route_check) X(16, check)
#define HELLO_FIELDS(X) X(8, sequence) X(8, protocol) X(16, dbc) X(8, profile) X(8, status) X(16, check)
#define MODE_REPLY_FIELDS(X) X(8, sequence) X(8, command) X(8, mode) X(8, fault) X(8, status) X(16, check)
#define MOTORS_FIELDS(X) X(16, left) X(16, right) X(8, sequence) X(8, tick_ms) X(16, check)
#define PARAMETER_FIELDS(X) X(8, sequence) X(8, parameter) X(8, status) X(32, value) X(16, check)
#define WAYPOINT_FIELDS(X) X(8, sequence) X(8, index) X(8, status) X(16, x) X(16, y) X(16, check)
#define ROUTE_FIELDS(X) X(8, sequence) X(8, count) X(16, route_check) X(8, status) X(16, check)
#define HEARTBEAT_FIELDS(X) X(32, tick) X(16, late_ticks) X(8, mode) X(8, fault) X(8, aborted)
#define FAULTS_FIELDS(X) X(16, bad) X(16, incomplete) X(16, stale) X(16, lost)
#define TELEMETRY_X_FIELDS(X) X(32, x) X(16, heading) X(8, tick_ms) X(8, waypoint)
#define TELEMETRY_Y_FIELDS(X) X(32, y) X(16, speed) X(8, tick_ms) X(8, overshoots)
#define TELEMETRY_TRACK_FIELDS(X)                                                                                      \
    X(16, yaw_rate)                                                                                                    \
    X(16, cross_track) X(16, heading_error) X(8, tick_ms) X(8, mode) X(8, phase) X(8, at_rest) X(8, valid)
#define TELEMETRY_DEMAND_FIELDS(X)                                                                                     \
    X(16, speed) X(16, heading) X(16, battery) X(8, tick_ms) X(8, fault) X(8, surge_saturated) X(8, yaw_saturated)
#define TELEMETRY_SPEED_FIELDS(X) X(16, proportional) X(16, integral) X(16, derivative) X(8, tick_ms)
#define TELEMETRY_HEADING_FIELDS(X) X(16, proportional) X(16, integral) X(16, derivative) X(8, tick_ms)
#define TELEMETRY_EFFORT_FIELDS(X) X(16, surge) X(16, yaw) X(8, tick_ms)

READ(open, OPEN_FIELDS)
READ(mode_command, MODE_COMMAND_FIELDS)
READ(imu, IMU_FIELDS)
READ(rotation, ROTATION_FIELDS)
READ(battery, BATTERY_FIELDS)
READ(reference_x, REFERENCE_X_FIELDS)
READ(reference_y, REFERENCE_Y_FIELDS)
READ(reference_turn, REFERENCE_TURN_FIELDS)
READ(sync, SYNC_FIELDS)
READ(parameter_request, PARAMETER_REQUEST_FIELDS)
READ(waypoint_request, WAYPOINT_REQUEST_FIELDS)
READ(route_request, ROUTE_REQUEST_FIELDS)
WRITTEN(hello, HELLO_FIELDS)
WRITTEN(mode_reply, MODE_REPLY_FIELDS)
WRITTEN(motors, MOTORS_FIELDS)
WRITTEN(parameter, PARAMETER_FIELDS)
WRITTEN(waypoint, WAYPOINT_FIELDS)
WRITTEN(route, ROUTE_FIELDS)
WRITTEN(heartbeat, HEARTBEAT_FIELDS)
WRITTEN(faults, FAULTS_FIELDS)
WRITTEN(telemetry_x, TELEMETRY_X_FIELDS)
WRITTEN(telemetry_y, TELEMETRY_Y_FIELDS)
WRITTEN(telemetry_track, TELEMETRY_TRACK_FIELDS)
WRITTEN(telemetry_demand, TELEMETRY_DEMAND_FIELDS)
WRITTEN(telemetry_speed, TELEMETRY_SPEED_FIELDS)
WRITTEN(telemetry_heading, TELEMETRY_HEADING_FIELDS)
WRITTEN(telemetry_effort, TELEMETRY_EFFORT_FIELDS)

/* Three messages, all of them in turn. */
void vectors_feed(void)
{
    static void (*const messages[])(uint8_t * data) = {open,
                                                       mode_command,
                                                       imu,
                                                       rotation,
                                                       battery,
                                                       reference_x,
                                                       reference_y,
                                                       reference_turn,
                                                       sync,
                                                       parameter_request,
                                                       waypoint_request,
                                                       route_request,
                                                       hello,
                                                       mode_reply,
                                                       motors,
                                                       parameter,
                                                       waypoint,
                                                       route,
                                                       heartbeat,
                                                       faults,
                                                       telemetry_x,
                                                       telemetry_y,
                                                       telemetry_track,
                                                       telemetry_demand,
                                                       telemetry_speed,
                                                       telemetry_heading,
                                                       telemetry_effort};
    enum { MESSAGES = sizeof messages / sizeof messages[0] };
    static uint8_t next;
    uint8_t data[SIZE];

    for (uint8_t i = 0; i < OF_VECTOR; i++) {
        messages[next](data);
        next = next + 1 < MESSAGES ? (uint8_t)(next + 1) : 0;
    }
}
