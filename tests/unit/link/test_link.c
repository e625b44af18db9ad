#include <string.h>

#include "link/link.h"
#include "sets.h"
#include "unity.h"

static link_port_t port;
static sets_reading_t reading;

void setUp(void)
{
    memset(&port, 0, sizeof port);
    reading = (sets_reading_t){.imu = {1, 2, 3}};
    link_bind(&port);
}
void tearDown(void)
{
    link_bind(NULL);
}

static link_event_t send_set(uint32_t time_ms, uint8_t sequence)
{
    message_t messages[SETS_MOST];
    link_event_t event = LINK_NOTHING;
    reading.time_ms = time_ms;
    reading.sequence = sequence;
    const int count = sets_pack(&reading, messages);
    for (int i = 0; i < count; i++)
        event = link_take(&port, &messages[i]);
    return event;
}

static struct wire_motors_t next_motors(void)
{
    struct wire_motors_t motors = {0};
    message_t message;
    TEST_ASSERT_TRUE(link_give(&port, &message));
    TEST_ASSERT_EQUAL_HEX16(WIRE_MOTORS_FRAME_ID, message.id);
    TEST_ASSERT_TRUE(crc_holds(&message));
    wire_motors_unpack(&motors, message.data, 8);
    return motors;
}

static void test_motors_answer_the_set_that_they_come_from(void)
{
    hal_motors_write(1, 1); /* before any set there is nothing to answer */
    message_t none;
    TEST_ASSERT_FALSE(link_give(&port, &none));
    TEST_ASSERT_EQUAL(LINK_STEP, send_set(600, 42));
    hal_motors_write(-5, 6);
    const struct wire_motors_t motors = next_motors();
    TEST_ASSERT_EQUAL_INT16(-5, motors.left);
    TEST_ASSERT_EQUAL_INT16(6, motors.right);
    TEST_ASSERT_EQUAL_UINT8(42, motors.sequence);
    TEST_ASSERT_EQUAL_UINT8((uint8_t)600, motors.tick_ms);
}

static void test_a_set_sent_again_is_answered_again_and_no_step_is_due(void)
{
    send_set(600, 42);
    hal_motors_write(-5, 6);
    next_motors();
    link_stepped(&port);
    TEST_ASSERT_EQUAL(LINK_NOTHING, send_set(600, 43));
    const struct wire_motors_t motors = next_motors();
    TEST_ASSERT_EQUAL_UINT8(43, motors.sequence);
    TEST_ASSERT_EQUAL_INT16(-5, motors.left);
    TEST_ASSERT_FALSE(port.fresh);
}

static void test_a_set_older_than_the_newest_steps_nothing(void)
{
    TEST_ASSERT_EQUAL(LINK_STEP, send_set(600, 1));
    TEST_ASSERT_EQUAL(LINK_NOTHING, send_set(597, 2));
    TEST_ASSERT_EQUAL_UINT32(600, hal_clock_ms());
}

static void test_a_session_begins_with_no_memory_of_the_one_before(void)
{
    const struct wire_open_t open = {.sequence = 1};
    message_t message = {.id = WIRE_OPEN_FRAME_ID, .size = 8};
    hal_imu_t imu;
    send_set(600, 1);
    link_count_bad(&port);
    wire_open_pack(message.data, &open, 8);
    message.data[7] = 1;
    link_take(&port, &message); /* its check fails */
    TEST_ASSERT_TRUE(port.set.any);
    crc_seal(&message);
    TEST_ASSERT_EQUAL(LINK_MESSAGE, link_take(&port, &message));
    TEST_ASSERT_EQUAL_UINT16(0, port.set.bad);
    TEST_ASSERT_EQUAL(HAL_ABSENT, hal_imu_read(&imu));
    TEST_ASSERT_EQUAL(LINK_STEP, send_set(0, 1));
}

static void test_faults_follow_a_heartbeat(void)
{
    const message_t heartbeat = {.id = WIRE_HEARTBEAT_FRAME_ID, .size = 8};
    struct wire_faults_t faults;
    message_t message;
    link_count_bad(&port);
    send_set(600, 1);
    send_set(597, 2);
    TEST_ASSERT_TRUE(hal_link_write(&heartbeat));
    TEST_ASSERT_TRUE(link_give(&port, &message));
    TEST_ASSERT_EQUAL_HEX16(WIRE_HEARTBEAT_FRAME_ID, message.id);
    TEST_ASSERT_TRUE(link_give(&port, &message));
    TEST_ASSERT_EQUAL_HEX16(WIRE_FAULTS_FRAME_ID, message.id);
    wire_faults_unpack(&faults, message.data, 8);
    TEST_ASSERT_EQUAL_UINT16(1, faults.bad);
    TEST_ASSERT_EQUAL_UINT16(1, faults.stale);
    TEST_ASSERT_EQUAL_UINT16(0, faults.incomplete);
}

static void test_a_flood_of_requests_is_cut_and_what_fits_is_kept(void)
{
    message_t got;
    for (uint8_t i = 0; i < 2 * LINK_IN; i++) {
        const message_t message = {.id = WIRE_MODE_COMMAND_FRAME_ID, .size = 1, .data = {i}};
        link_take(&port, &message);
    }
    for (uint8_t i = 0; i < LINK_IN; i++) {
        TEST_ASSERT_TRUE(hal_link_read(&got));
        TEST_ASSERT_EQUAL_UINT8(i, got.data[0]);
    }
    TEST_ASSERT_FALSE(hal_link_read(&got));
}

static void test_motors_that_find_no_room_are_counted(void)
{
    send_set(3, 1);
    for (int i = 0; i < LINK_OUT + 3; i++)
        hal_motors_write(1, 1);
    TEST_ASSERT_EQUAL_UINT16(3, port.lost);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_motors_answer_the_set_that_they_come_from);
    RUN_TEST(test_a_set_sent_again_is_answered_again_and_no_step_is_due);
    RUN_TEST(test_a_set_older_than_the_newest_steps_nothing);
    RUN_TEST(test_a_session_begins_with_no_memory_of_the_one_before);
    RUN_TEST(test_faults_follow_a_heartbeat);
    RUN_TEST(test_a_flood_of_requests_is_cut_and_what_fits_is_kept);
    RUN_TEST(test_motors_that_find_no_room_are_counted);
    return UNITY_END();
}
