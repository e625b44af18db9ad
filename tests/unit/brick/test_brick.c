#include <string.h>

#include "../link/sets.h"
#include "brick/brick.h"
#include "unity.h"

static brick_t brick;
static sets_reading_t reading;
static struct wire_motors_t motors; /* the newest */

void setUp(void)
{
    brick_start(&brick);
    memset(&motors, 0, sizeof motors);
    reading = (sets_reading_t){.imu_status = HAL_ABSENT, .rotation_status = HAL_ABSENT, .battery_mv = 9000};
}
void tearDown(void) {}

static int take_answers(void)
{
    message_t message;
    int count = 0;
    while (brick_give(&brick, &message))
        if (message.id == WIRE_MOTORS_FRAME_ID) {
            TEST_ASSERT_TRUE(crc_holds(&message));
            wire_motors_unpack(&motors, message.data, 8);
            count++;
        }
    return count;
}

static void request(uint16_t id, const uint8_t *data)
{
    message_t message = {.id = id, .size = 8};
    memcpy(message.data, data, 8);
    crc_seal(&message);
    brick_take(&brick, &message);
}

static void command(uint8_t what)
{
    const struct wire_mode_command_t asked = {.command = what};
    uint8_t data[8];
    wire_mode_command_pack(data, &asked, 8);
    request(WIRE_MODE_COMMAND_FRAME_ID, data);
}

/* A session with a waypoint 2 m ahead. */
static void begin(uint8_t pace)
{
    static const uint8_t AHEAD[] = {0xD0, 0x07, 0, 0};
    const struct wire_open_t open = {.protocol = WIRE_PROTOCOL, .dbc = WIRE_DBC, .pace = pace};
    const struct wire_waypoint_request_t waypoint = {.write = 1, .x = 2000};
    const struct wire_route_request_t route = {
        .write = 1, .count = 1, .route_check = crc_of_bytes(CRC_START, AHEAD, 4)};
    uint8_t data[8];
    wire_open_pack(data, &open, 8);
    request(WIRE_OPEN_FRAME_ID, data);
    wire_waypoint_request_pack(data, &waypoint, 8);
    request(WIRE_WAYPOINT_REQUEST_FRAME_ID, data);
    wire_route_request_pack(data, &route, 8);
    request(WIRE_ROUTE_REQUEST_FRAME_ID, data);
    TEST_ASSERT_EQUAL_UINT8(1, brick.commands.route.count);
    command(MODE_START);
    take_answers();
}

static void send_set(void)
{
    message_t messages[SETS_MOST];
    reading.time_ms += 3;
    reading.sequence++;
    const int count = sets_pack(&reading, messages);
    for (int i = 0; i < count; i++)
        brick_take(&brick, &messages[i]);
}

static void test_in_lockstep_each_set_is_answered_once(void)
{
    begin(WIRE_OPEN_PACE_LOCKSTEP_CHOICE);
    for (int i = 0; i < 100; i++) {
        send_set();
        TEST_ASSERT_EQUAL_INT(1, take_answers());
        TEST_ASSERT_EQUAL_UINT8(reading.sequence, motors.sequence);
    }
    TEST_ASSERT_GREATER_THAN_INT16(1000, motors.left);
}

static void test_in_lockstep_a_second_of_silence_stops_the_motors_for_good(void)
{
    begin(WIRE_OPEN_PACE_LOCKSTEP_CHOICE);
    brick_time(&brick, 5000000);
    send_set();
    take_answers();
    TEST_ASSERT_NOT_EQUAL(0, motors.left);
    brick_time(&brick, 5000000 + BRICK_SILENT_US - 1);
    TEST_ASSERT_EQUAL_INT(0, take_answers());
    brick_time(&brick, 5000000 + BRICK_SILENT_US);
    TEST_ASSERT_EQUAL_INT(1, take_answers());
    TEST_ASSERT_EQUAL_INT16(0, motors.left);
    TEST_ASSERT_EQUAL(MODE_FAULT, brick.loop.step.mode.mode);
    TEST_ASSERT_EQUAL(MODE_SILENT, brick.loop.step.mode.fault);
    for (int i = 0; i < 10; i++)
        send_set();
    command(MODE_START);
    send_set();
    take_answers();
    TEST_ASSERT_EQUAL_INT16(0, motors.left);
    command(MODE_RESET);
    send_set();
    command(MODE_START);
    for (int i = 0; i < 20; i++)
        send_set();
    take_answers();
    TEST_ASSERT_NOT_EQUAL(0, motors.left);
}

static void test_in_real_time_steps_follow_the_clock(void)
{
    begin(WIRE_OPEN_PACE_REALTIME_CHOICE);
    int steps = 0;
    for (int64_t now_us = 0; now_us < 300000; now_us += 500) {
        if (now_us % 3000 == 0)
            send_set();
        const int64_t wait_us = brick_time(&brick, now_us);
        TEST_ASSERT_GREATER_OR_EQUAL_INT64(0, wait_us);
        TEST_ASSERT_LESS_OR_EQUAL_INT64(BRICK_STEP_US, wait_us);
        steps += take_answers();
    }
    TEST_ASSERT_INT_WITHIN(1, 100, steps);
    TEST_ASSERT_GREATER_THAN_INT16(1000, motors.left);
    TEST_ASSERT_EQUAL_UINT16(0, brick.loop.late_ticks);
}

static void test_in_real_time_silence_stops_the_motors_within_the_stated_time(void)
{
    int64_t stopped_us = 0;
    begin(WIRE_OPEN_PACE_REALTIME_CHOICE);
    for (int64_t now_us = 0; now_us < 600000; now_us += 1000) {
        if (now_us % 3000 == 0 && now_us < 300000)
            send_set();
        brick_time(&brick, now_us);
        if (take_answers() > 0 && motors.left == 0 && now_us > 300000 && stopped_us == 0)
            stopped_us = now_us - 300000;
    }
    TEST_ASSERT_INT64_WITHIN(10000, 1000L * brick.commands.parameters.config.silent_ms, stopped_us);
    TEST_ASSERT_EQUAL(MODE_SILENT, brick.loop.step.mode.fault);
}

static void test_steps_that_were_slept_through_are_not_made_up_for(void)
{
    begin(WIRE_OPEN_PACE_REALTIME_CHOICE);
    brick_time(&brick, 0);
    send_set();
    brick_time(&brick, 3000);
    take_answers();
    send_set();
    brick_time(&brick, 40000);
    TEST_ASSERT_EQUAL_INT(1, take_answers());
    brick_time(&brick, 40500);
    TEST_ASSERT_EQUAL_INT(0, take_answers());
    TEST_ASSERT_EQUAL_UINT16(1, brick.loop.late_ticks);
}

static void test_a_brick_without_a_session_keeps_its_motors_off(void)
{
    command(MODE_START);
    for (int i = 0; i < 50; i++)
        send_set();
    take_answers();
    TEST_ASSERT_EQUAL_INT16(0, motors.left);
    TEST_ASSERT_EQUAL(MODE_IDLE, brick.loop.step.mode.mode);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_in_lockstep_each_set_is_answered_once);
    RUN_TEST(test_in_lockstep_a_second_of_silence_stops_the_motors_for_good);
    RUN_TEST(test_in_real_time_steps_follow_the_clock);
    RUN_TEST(test_in_real_time_silence_stops_the_motors_within_the_stated_time);
    RUN_TEST(test_steps_that_were_slept_through_are_not_made_up_for);
    RUN_TEST(test_a_brick_without_a_session_keeps_its_motors_off);
    return UNITY_END();
}
