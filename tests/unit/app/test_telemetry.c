#include <string.h>

#include "app/telemetry.h"
#include "unity.h"
#include "wire/codecs_gen.h"

enum { TICK_MS = 0x5A };

static loop_state_t loop;
static step_state_t *const state = &loop.step;
static step_output_t *const output = &loop.output;
static message_t parts[TELEMETRY_PARTS];

void setUp(void)
{
    memset(&loop, 0, sizeof loop);
    loop.clock_ms = 0x01020300 + TICK_MS;
    memset(parts, 0xAA, sizeof parts);
}
void tearDown(void) {}

static void pack(void)
{
    for (uint8_t i = 0; i < TELEMETRY_PARTS; i++)
        telemetry_part(i, &loop, &parts[i]);
}

static void test_telemetry_carries_the_estimate(void)
{
    struct wire_telemetry_x_t x;
    struct wire_telemetry_y_t y;
    struct wire_telemetry_track_t track;
    state->mode.mode = MODE_RUN;
    state->mode.los.phase = LOS_TURN;
    state->mode.los.waypoint = 5;
    state->mode.los.overshoots = 300;
    state->mode.los.cross_track_mm = -321;
    state->mode.los.heading_error_bam16 = -3000;
    output->estimate = (signals_estimate_t){.x_um = -1234567,
                                            .y_um = 7654321,
                                            .heading_bam16 = 50000,
                                            .speed_mm_s_q4 = -4321,
                                            .yaw_rate_mrad_s = -99,
                                            .at_rest = true};
    pack();
    wire_telemetry_x_unpack(&x, parts[0].data, 8);
    wire_telemetry_y_unpack(&y, parts[1].data, 8);
    wire_telemetry_track_unpack(&track, parts[2].data, 8);
    TEST_ASSERT_EQUAL_INT32(-1234567, x.x);
    TEST_ASSERT_EQUAL_INT16((int16_t)50000, x.heading);
    TEST_ASSERT_EQUAL_UINT8(5, x.waypoint);
    TEST_ASSERT_EQUAL_INT32(7654321, y.y);
    TEST_ASSERT_EQUAL_INT16(-4321, y.speed);
    TEST_ASSERT_EQUAL_UINT8(255, y.overshoots);
    TEST_ASSERT_EQUAL_INT16(-99, track.yaw_rate);
    TEST_ASSERT_EQUAL_INT16(-321, track.cross_track);
    TEST_ASSERT_EQUAL_INT16(-3000, track.heading_error);
    TEST_ASSERT_EQUAL_UINT8(MODE_RUN, track.mode);
    TEST_ASSERT_EQUAL_UINT8(LOS_TURN, track.phase);
    TEST_ASSERT_EQUAL_UINT8(1, track.at_rest);
    TEST_ASSERT_EQUAL_UINT8(0, track.valid);
    TEST_ASSERT_EQUAL_UINT8(0, track.bias_unknown);
    output->estimate = (signals_estimate_t){.bias_unknown = true};
    pack();
    wire_telemetry_track_unpack(&track, parts[2].data, 8);
    TEST_ASSERT_EQUAL_UINT8(1, track.bias_unknown);
    TEST_ASSERT_EQUAL_UINT8(0, track.valid);
    TEST_ASSERT_EQUAL_UINT8(MODE_RUN, track.mode);
}

static void test_telemetry_carries_demands_and_efforts(void)
{
    struct wire_telemetry_demand_t demand;
    struct wire_telemetry_speed_t speed;
    struct wire_telemetry_heading_t heading;
    struct wire_telemetry_effort_t effort;
    state->mode.fault = MODE_SILENT;
    output->demand = (signals_demand_t){.speed_mm_s_q4 = 4800, .heading_bam16 = 40000};
    output->drive = (signals_drive_t){.surge_saturated = -1, .yaw_saturated = 1};
    state->mixer.battery_mv = 8765;
    output->speed_pid = (pid_output_t){.proportional_mv = 1, .integral_mv = -2, .derivative_mv = 3};
    output->heading_pid = (pid_output_t){.proportional_mv = -4, .integral_mv = 5, .derivative_mv = -6};
    output->effort = (signals_effort_t){.surge_mv = 4500, .yaw_mv = -700};
    state->heading.full_steps = 50000;
    pack();
    wire_telemetry_demand_unpack(&demand, parts[3].data, 8);
    wire_telemetry_speed_unpack(&speed, parts[4].data, 8);
    wire_telemetry_heading_unpack(&heading, parts[5].data, 8);
    wire_telemetry_effort_unpack(&effort, parts[6].data, 8);
    TEST_ASSERT_EQUAL_INT16(4800, demand.speed);
    TEST_ASSERT_EQUAL_INT16((int16_t)40000, demand.heading);
    TEST_ASSERT_EQUAL_UINT16(8765, demand.battery);
    TEST_ASSERT_EQUAL_UINT8(MODE_SILENT, demand.fault);
    TEST_ASSERT_EQUAL_INT8(-1, demand.surge_saturated);
    TEST_ASSERT_EQUAL_INT8(1, demand.yaw_saturated);
    TEST_ASSERT_EQUAL_INT16(-2, speed.integral);
    TEST_ASSERT_EQUAL_INT16(3, speed.derivative);
    TEST_ASSERT_EQUAL_INT16(-4, heading.proportional);
    TEST_ASSERT_EQUAL_INT16(5, heading.integral);
    TEST_ASSERT_EQUAL_INT16(4500, effort.surge);
    TEST_ASSERT_EQUAL_INT16(-700, effort.yaw);
    TEST_ASSERT_EQUAL_UINT16(50000, effort.gyro_full);
}

static void test_telemetry_parts_have_ids_in_a_row_and_the_same_tick(void)
{
    pack();
    for (uint8_t i = 0; i < TELEMETRY_PARTS; i++) {
        TEST_ASSERT_EQUAL_UINT16(WIRE_TELEMETRY_X_FRAME_ID + i, parts[i].id);
        TEST_ASSERT_EQUAL_UINT8(8, parts[i].size);
        TEST_ASSERT_EQUAL_HEX8(TICK_MS, parts[i].data[6]);
        TEST_ASSERT_EQUAL_HEX8(0, parts[i].data[7]); /* nothing is left of the message before */
    }
}

static void test_heartbeat_tells_mode_and_counts(void)
{
    struct wire_heartbeat_t heartbeat;
    message_t message;
    state->mode.mode = MODE_FAULT;
    state->mode.fault = MODE_COMMANDED;
    loop.tick = 0x01020304;
    loop.late_ticks = 500;
    loop.aborted = 256;
    telemetry_heartbeat(&loop, &message);
    TEST_ASSERT_EQUAL_UINT16(WIRE_HEARTBEAT_FRAME_ID, message.id);
    wire_heartbeat_unpack(&heartbeat, message.data, 8);
    TEST_ASSERT_EQUAL_HEX32(0x01020304, heartbeat.tick);
    TEST_ASSERT_EQUAL_UINT16(500, heartbeat.late_ticks);
    TEST_ASSERT_EQUAL_UINT8(MODE_FAULT, heartbeat.mode);
    TEST_ASSERT_EQUAL_UINT8(MODE_COMMANDED, heartbeat.fault);
    TEST_ASSERT_EQUAL_UINT8(255, heartbeat.aborted);
}

static void test_monitor_message_tells_the_report_of_its_channel(void)
{
    struct wire_monitor_battery_t battery;
    message_t message;
    state->monitor.report[MONITOR_BATTERY] = (monitor_report_t){0x12345678, -250, MONITOR_SUPPLY};
    loop.clock_ms = 0x107;
    telemetry_monitor(MONITOR_BATTERY, &loop, &message);
    TEST_ASSERT_EQUAL_UINT16(WIRE_MONITOR_BATTERY_FRAME_ID, message.id);
    TEST_ASSERT_EQUAL_UINT8(8, message.size);
    wire_monitor_battery_unpack(&battery, message.data, 8);
    TEST_ASSERT_EQUAL_INT16(-250, battery.amount);
    TEST_ASSERT_EQUAL_HEX32(0x12345678, battery.since);
    TEST_ASSERT_EQUAL_UINT8(WIRE_MONITOR_BATTERY_CAUSE_SUPPLY_CHOICE, battery.cause);
    TEST_ASSERT_EQUAL_HEX8(7, battery.tick_ms);
}

static void test_telemetry_counts_up_to_255_and_tells_a_valid_state(void)
{
    struct wire_telemetry_y_t y;
    struct wire_telemetry_track_t track;
    state->mode.los.overshoots = 200;
    output->estimate = (signals_estimate_t){.valid = true};
    pack();
    wire_telemetry_y_unpack(&y, parts[1].data, 8);
    wire_telemetry_track_unpack(&track, parts[2].data, 8);
    TEST_ASSERT_EQUAL_UINT8(200, y.overshoots);
    TEST_ASSERT_EQUAL_UINT8(1, track.valid);
    TEST_ASSERT_EQUAL_UINT8(0, track.at_rest);
    TEST_ASSERT_EQUAL_UINT8(0, track.bias_unknown);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_telemetry_carries_the_estimate);
    RUN_TEST(test_telemetry_carries_demands_and_efforts);
    RUN_TEST(test_telemetry_parts_have_ids_in_a_row_and_the_same_tick);
    RUN_TEST(test_heartbeat_tells_mode_and_counts);
    RUN_TEST(test_telemetry_counts_up_to_255_and_tells_a_valid_state);
    RUN_TEST(test_monitor_message_tells_the_report_of_its_channel);
    return UNITY_END();
}
