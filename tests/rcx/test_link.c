/* test_link.c: what hal/rcx/infrared.c does beyond the contract of every port, beside brickOS's own kernel. */
#include "rcx/test_link.h"

#include "app/serve.h"
#include "hal.h"
#include "port.h"
#include "port_rcx.h"
#include "rcx/infrared.h"
#include "unity.h"
#include "wire/codecs_gen.h"
#include "wire/crc.h"

static commands_t commands;
static loop_state_t state;
static uint8_t asked; /* sequence number of the next request */

/* serve() calls it; the rest of the loop is not in this program. */
void loop_heard(loop_state_t *heard)
{
    heard->silent_ms = 0;
}

/* Sends a request over the air to serve(), and receives the reply over the air. */
static void ask(message_t *request, message_t *answer)
{
    request->size = 8;
    request->data[0] = asked++;
    crc_seal(request);
    TEST_ASSERT_TRUE(port_host_send(request));
    serve(&commands, &state);
    TEST_ASSERT_TRUE(port_host_receive(answer));
    TEST_ASSERT_TRUE(crc_holds(answer));
    TEST_ASSERT_EQUAL_UINT8(request->data[0], answer->data[0]);
}

static void open_session(void)
{
    message_t request = {.id = WIRE_OPEN_FRAME_ID}, answer;

    commands_start(&commands);
    request.data[1] = WIRE_PROTOCOL;
    request.data[2] = (uint8_t)WIRE_DBC;
    request.data[3] = (uint8_t)(WIRE_DBC >> 8);
    request.data[4] = 0;
    request.data[5] = WIRE_OPEN_PACE_REALTIME_CHOICE;
    ask(&request, &answer);
    TEST_ASSERT_EQUAL_HEX16(WIRE_HELLO_FRAME_ID, answer.id);
    TEST_ASSERT_EQUAL_UINT8(WIRE_HELLO_STATUS_OK_CHOICE, answer.data[5]);
    TEST_ASSERT_TRUE(commands.open);
}

static void test_port_a_setting_changes_over_the_air(void)
{
    message_t request = {.id = WIRE_PARAMETER_REQUEST_FRAME_ID}, answer;

    open_session();
    TEST_ASSERT_TRUE(commands.parameters.config.step.heading_pid.kp_mv_q10 != 1100);
    request.data[1] = 0x40 | WIRE_PARAMETER_REQUEST_PARAMETER_HEADING_KP_CHOICE;
    request.data[2] = 0x4C; /* 1100 */
    request.data[3] = 0x04;
    ask(&request, &answer);
    TEST_ASSERT_EQUAL_HEX16(WIRE_PARAMETER_FRAME_ID, answer.id);
    TEST_ASSERT_EQUAL_UINT8(0, answer.data[1] >> 6);
    TEST_ASSERT_EQUAL_INT16(1100, commands.parameters.config.step.heading_pid.kp_mv_q10);
}

static void write_waypoint(uint8_t index, int16_t x_mm, int16_t y_mm)
{
    message_t request = {.id = WIRE_WAYPOINT_REQUEST_FRAME_ID}, answer;

    request.data[1] = (uint8_t)(0x40 | index);
    request.data[2] = (uint8_t)x_mm;
    request.data[3] = (uint8_t)((uint16_t)x_mm >> 8);
    request.data[4] = (uint8_t)y_mm;
    request.data[5] = (uint8_t)((uint16_t)y_mm >> 8);
    ask(&request, &answer);
    TEST_ASSERT_EQUAL_HEX16(WIRE_WAYPOINT_FRAME_ID, answer.id);
    TEST_ASSERT_EQUAL_UINT8(0, answer.data[1] >> 6);
}

static void test_port_a_route_changes_over_the_air(void)
{
    static const uint8_t coordinates[] = {0x20, 0x03, 0xD4, 0xFE, 0x00, 0x00, 0x90, 0x01}; /* 800, -300, 0, 400 */
    const uint16_t check = crc_of_bytes(CRC_START, coordinates, sizeof coordinates);
    message_t request = {.id = WIRE_ROUTE_REQUEST_FRAME_ID}, answer;

    open_session();
    write_waypoint(0, 800, -300);
    write_waypoint(1, 0, 400);
    request.data[1] = 0x40 | 2;
    request.data[2] = (uint8_t)check;
    request.data[3] = (uint8_t)(check >> 8);
    ask(&request, &answer);
    TEST_ASSERT_EQUAL_HEX16(WIRE_ROUTE_FRAME_ID, answer.id);
    TEST_ASSERT_EQUAL_UINT8(0, answer.data[4]);
    TEST_ASSERT_EQUAL_UINT8(2, commands.route.count);
    TEST_ASSERT_EQUAL_INT16(-300, commands.route.waypoints[0].y_mm);
    TEST_ASSERT_EQUAL_INT16(400, commands.route.waypoints[1].y_mm);
}

static uint16_t fault(uint8_t at)
{
    return message_get(&infrared_faults[at]);
}

static void test_port_a_repetition_is_answered_again_and_not_obeyed(void)
{
    message_t request = {.id = WIRE_MODE_COMMAND_FRAME_ID}, answer;
    const uint16_t repeated = fault(WIRE_FAULTS_STALE_AT);

    open_session();
    request.data[1] = MODE_START;
    ask(&request, &answer);
    TEST_ASSERT_EQUAL(MODE_START, commands_next(&commands));
    for (uint8_t again = 0; again < 2; again++) {
        port_host_repeat();
        serve(&commands, &state);
        TEST_ASSERT_EQUAL(MODE_NONE, commands_next(&commands));
        TEST_ASSERT_TRUE(port_host_receive(&answer));
        TEST_ASSERT_EQUAL_HEX16(WIRE_MODE_REPLY_FRAME_ID, answer.id);
        TEST_ASSERT_TRUE(crc_holds(&answer));
    }
    TEST_ASSERT_EQUAL_UINT16(repeated + 2, fault(WIRE_FAULTS_STALE_AT));
    TEST_ASSERT_FALSE(port_host_receive(&answer));
}

static void test_port_what_finds_no_room_is_counted(void)
{
    const message_t message = {.id = WIRE_MODE_COMMAND_FRAME_ID, .size = 8};
    const uint16_t lost = fault(WIRE_FAULTS_LOST_AT);
    message_t got;
    uint8_t count = 0;

    for (uint8_t i = 0; i < 1 + 3; i++)
        (void)port_host_send(&message);
    TEST_ASSERT_EQUAL_UINT16(lost + 3, fault(WIRE_FAULTS_LOST_AT));
    while (hal_link_read(&got))
        count++;
    TEST_ASSERT_EQUAL_UINT8(1, count);
    port_host_repeat(); /* a lost message is no repetition */
    TEST_ASSERT_TRUE(hal_link_read(&got));
}

static void test_port_what_is_no_message_is_left_out(void)
{
    static const uint8_t wrong_sum[] = {0xF1, 5, INFRARED_PORT, 0x87, 200, 0x30, 0x00, 0x00};
    uint8_t other_port[] = {0xF1, 5, INFRARED_PORT - 1, 0x87, 201, 0x30, 0x00, 0xFF};
    uint8_t too_short[] = {0xF1, 4, INFRARED_PORT, 0x87, 202, 0x30, 0xFF};
    const uint16_t bad = fault(WIRE_FAULTS_BAD_AT);
    message_t got;

    for (uint8_t i = 0; i < sizeof other_port - 1; i++)
        other_port[sizeof other_port - 1] = (uint8_t)(other_port[sizeof other_port - 1] + other_port[i]);
    for (uint8_t i = 0; i < sizeof too_short - 1; i++)
        too_short[sizeof too_short - 1] = (uint8_t)(too_short[sizeof too_short - 1] + too_short[i]);
    world_send(wrong_sum, sizeof wrong_sum);
    world_send(other_port, sizeof other_port);
    TEST_ASSERT_EQUAL_UINT16(bad, fault(WIRE_FAULTS_BAD_AT));
    world_send(too_short, sizeof too_short);
    TEST_ASSERT_EQUAL_UINT16(bad + 1, fault(WIRE_FAULTS_BAD_AT));
    TEST_ASSERT_FALSE(hal_link_read(&got));
}

static void test_port_faults_follow_a_heartbeat(void)
{
    const message_t heartbeat = {.id = WIRE_HEARTBEAT_FRAME_ID, .size = 8};
    message_t got;

    TEST_ASSERT_TRUE(hal_link_write(&heartbeat));
    TEST_ASSERT_FALSE(infrared_idle());
    TEST_ASSERT_TRUE(port_host_receive(&got));
    TEST_ASSERT_EQUAL_HEX16(WIRE_HEARTBEAT_FRAME_ID, got.id);
    TEST_ASSERT_TRUE(port_host_receive(&got));
    TEST_ASSERT_EQUAL_HEX16(WIRE_FAULTS_FRAME_ID, got.id);
    TEST_ASSERT_EQUAL_UINT8(1, got.data[WIRE_FAULTS_BAD_AT]); /* from the tests above */
    TEST_ASSERT_EQUAL_UINT8(0, got.data[WIRE_FAULTS_INCOMPLETE_AT]);
    TEST_ASSERT_EQUAL_UINT8(2, got.data[WIRE_FAULTS_STALE_AT]);
    TEST_ASSERT_EQUAL_UINT8(3, got.data[WIRE_FAULTS_LOST_AT]);
    world_run(10); /* the kernel notices that the message is out */
    TEST_ASSERT_TRUE(infrared_idle());
}

static void test_port_a_collision_costs_one_message(void)
{
    const message_t message = {.id = WIRE_TELEMETRY_X_FRAME_ID, .size = 8};
    message_t got;

    world_disturb();
    TEST_ASSERT_TRUE(hal_link_write(&message));
    world_run(200);
    world_forget();
    TEST_ASSERT_TRUE(hal_link_write(&message));
    TEST_ASSERT_TRUE(port_host_receive(&got));
    TEST_ASSERT_EQUAL_HEX16(WIRE_TELEMETRY_X_FRAME_ID, got.id);
}

void run_link_tests(void)
{
    RUN_TEST(test_port_a_setting_changes_over_the_air);
    RUN_TEST(test_port_a_route_changes_over_the_air);
    RUN_TEST(test_port_a_repetition_is_answered_again_and_not_obeyed);
    RUN_TEST(test_port_what_finds_no_room_is_counted);
    RUN_TEST(test_port_what_is_no_message_is_left_out);
    RUN_TEST(test_port_faults_follow_a_heartbeat);
    RUN_TEST(test_port_a_collision_costs_one_message);
}
