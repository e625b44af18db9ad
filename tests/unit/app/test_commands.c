#include <string.h>

#include "app/commands.h"
#include "app/params_gen.h"
#include "app/serve.h"
#include "app/settings_gen.h"
#include "sil/sil.h"
#include "unity.h"
#include "wire/crc.h"
#include "wire/codecs_gen.h"

static commands_t commands;
static loop_state_t loop;
static message_t request, reply; /* a request and what becomes of it */

static bool send(uint16_t id)
{
    request.id = id;
    request.size = 8;
    crc_seal(&request);
    reply = request;
    const bool result = commands_take(&commands, &loop, &reply);
    if (result)
        TEST_ASSERT_TRUE(crc_holds(&reply));
    return result;
}

static bool open_with(struct wire_open_t open)
{
    wire_open_pack(request.data, &open, 8);
    return send(WIRE_OPEN_FRAME_ID);
}

static struct wire_open_t sound_open(void)
{
    return (struct wire_open_t){.sequence = 9, .protocol = WIRE_PROTOCOL, .dbc = WIRE_DBC};
}

void setUp(void)
{
    memset(&loop, 0, sizeof loop);
    memset(&request, 0, sizeof request);
    commands_start(&commands);
    TEST_ASSERT_TRUE(open_with(sound_open()));
}
void tearDown(void) {}

static struct wire_parameter_t parameter(uint8_t index, bool write, int32_t value)
{
    const struct wire_parameter_request_t asked = {.sequence = 5, .parameter = index, .write = write, .value = value};
    struct wire_parameter_t answer;
    wire_parameter_request_pack(request.data, &asked, 8);
    TEST_ASSERT_TRUE(send(WIRE_PARAMETER_REQUEST_FRAME_ID));
    TEST_ASSERT_EQUAL_UINT16(WIRE_PARAMETER_FRAME_ID, reply.id);
    wire_parameter_unpack(&answer, reply.data, 8);
    TEST_ASSERT_EQUAL_UINT8(5, answer.sequence);
    TEST_ASSERT_EQUAL_UINT8(index, answer.parameter);
    return answer;
}

static struct wire_waypoint_t waypoint(uint8_t index, bool write, int16_t x_mm, int16_t y_mm)
{
    const struct wire_waypoint_request_t asked = {.sequence = 6, .index = index, .write = write, .x = x_mm, .y = y_mm};
    struct wire_waypoint_t answer;
    wire_waypoint_request_pack(request.data, &asked, 8);
    TEST_ASSERT_TRUE(send(WIRE_WAYPOINT_REQUEST_FRAME_ID));
    wire_waypoint_unpack(&answer, reply.data, 8);
    TEST_ASSERT_EQUAL_UINT8(6, answer.sequence);
    return answer;
}

static struct wire_route_t commit(bool write, uint8_t count, uint16_t check)
{
    const struct wire_route_request_t asked = {.sequence = 7, .count = count, .write = write, .route_check = check};
    struct wire_route_t answer;
    wire_route_request_pack(request.data, &asked, 8);
    TEST_ASSERT_TRUE(send(WIRE_ROUTE_REQUEST_FRAME_ID));
    wire_route_unpack(&answer, reply.data, 8);
    TEST_ASSERT_EQUAL_UINT8(7, answer.sequence);
    return answer;
}

/* CRC over two waypoints, (1000, -1000) and (0, 500), low bytes first. */
static uint16_t check_of_two(void)
{
    static const uint8_t BYTES[] = {0xE8, 0x03, 0x18, 0xFC, 0x00, 0x00, 0xF4, 0x01};
    return crc_of_bytes(CRC_START, BYTES, sizeof BYTES);
}

static void upload_two(void)
{
    waypoint(0, true, 1000, -1000);
    waypoint(1, true, 0, 500);
}

static uint8_t command(uint8_t what)
{
    const struct wire_mode_command_t asked = {.sequence = 8, .command = what};
    struct wire_mode_reply_t answer;
    wire_mode_command_pack(request.data, &asked, 8);
    TEST_ASSERT_TRUE(send(WIRE_MODE_COMMAND_FRAME_ID));
    wire_mode_reply_unpack(&answer, reply.data, 8);
    TEST_ASSERT_EQUAL_UINT8(8, answer.sequence);
    return answer.status;
}

static void test_open_says_who_is_there_and_what_differs(void)
{
    struct wire_hello_t hello;
    struct wire_open_t open = sound_open();
    open.profile = WIRE_OPEN_PROFILE_PAPER_CHOICE;
    open.pace = WIRE_OPEN_PACE_REALTIME_CHOICE;
    loop.tick = 7;
    TEST_ASSERT_TRUE(open_with(open));
    TEST_ASSERT_EQUAL_UINT32(0, loop.tick); /* begun anew */
    TEST_ASSERT_TRUE(commands.open);
    wire_hello_unpack(&hello, reply.data, 8);
    TEST_ASSERT_EQUAL_UINT8(9, hello.sequence);
    TEST_ASSERT_EQUAL_UINT8(WIRE_HELLO_STATUS_OK_CHOICE, hello.status);
    TEST_ASSERT_TRUE(commands.realtime);
    TEST_ASSERT_EQUAL_INT16(PARAMS_PAPER.step.speed_pid.kp_mv_q10, commands.parameters.config.step.speed_pid.kp_mv_q10);
    const uint8_t wanted[] = {WIRE_HELLO_STATUS_PROTOCOL_DIFFERS_CHOICE, WIRE_HELLO_STATUS_DBC_DIFFERS_CHOICE,
                              WIRE_HELLO_STATUS_NO_SUCH_PROFILE_CHOICE, WIRE_HELLO_STATUS_NO_SUCH_PACE_CHOICE};
    for (int i = 0; i < 4; i++) {
        open = sound_open();
        open.protocol = (uint8_t)(open.protocol + (i == 0));
        open.dbc = (uint16_t)(open.dbc + (i == 1));
        open.profile = i == 2 ? 2 : 0;
        open.pace = i == 3 ? 2 : 0;
        loop.tick = 7;
        TEST_ASSERT_TRUE(open_with(open));
        TEST_ASSERT_EQUAL_UINT32(7, loop.tick);
        wire_hello_unpack(&hello, reply.data, 8);
        TEST_ASSERT_EQUAL_UINT8(wanted[i], hello.status);
        TEST_ASSERT_EQUAL_UINT8(WIRE_PROTOCOL, hello.protocol);
        TEST_ASSERT_EQUAL_HEX16(WIRE_DBC, hello.dbc);
    }
}

static void test_nothing_is_done_before_a_session_or_with_a_check_that_fails(void)
{
    commands_start(&commands);
    for (uint16_t id = WIRE_OPEN_FRAME_ID + 1; id <= WIRE_ROUTE_FRAME_ID; id++)
        TEST_ASSERT_FALSE(send(id));
    open_with(sound_open());
    const struct wire_mode_command_t asked = {.command = MODE_START};
    wire_mode_command_pack(request.data, &asked, 8);
    request.id = WIRE_MODE_COMMAND_FRAME_ID;
    crc_seal(&request);
    request.data[7] ^= 1;
    TEST_ASSERT_FALSE(commands_take(&commands, &loop, &request));
    TEST_ASSERT_EQUAL(MODE_NONE, commands_next(&commands));
    TEST_ASSERT_FALSE(send(0x7FF));
}

static void test_every_parameter_is_read_and_written_within_its_range(void)
{
    for (uint8_t i = 0; i < SETTINGS_COUNT; i++) {
        const struct wire_parameter_t before = parameter(i, false, 0);
        TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, before.status);
        const struct wire_parameter_t written = parameter(i, true, before.value == 1 ? 0 : before.value);
        TEST_ASSERT_TRUE(written.status == PARAMETERS_OK || written.status == PARAMETERS_RANGE);
        const struct wire_parameter_t same = parameter(i, true, before.value);
        TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, same.status);
        TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, parameter(i, true, -2147483647L).status);
        if (i != WIRE_PARAMETER_REQUEST_PARAMETER_LEG_TIMEOUT_CHOICE)
            TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, parameter(i, true, 2147483647L).status);
        TEST_ASSERT_EQUAL_INT32(before.value, parameter(i, false, 0).value);
    }
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_UNKNOWN, parameter(SETTINGS_COUNT, false, 0).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_UNKNOWN, parameter(63, true, 0).status);
}

static void test_a_gain_takes_effect_and_its_ends_are_inclusive(void)
{
    const uint8_t kp = WIRE_PARAMETER_REQUEST_PARAMETER_HEADING_KP_CHOICE;
    TEST_ASSERT_EQUAL_INT32(PARAMS_COUPLED.step.heading_pid.kp_mv_q10, parameter(kp, false, 0).value);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, parameter(kp, true, 32767).status);
    TEST_ASSERT_EQUAL_INT16(32767, commands.parameters.config.step.heading_pid.kp_mv_q10);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, parameter(kp, true, 32768).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, parameter(kp, true, 0).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, parameter(kp, true, -1).status);
}

static void test_what_is_known_of_the_robot_is_written_setting_by_setting_and_not_while_it_drives(void)
{
    static const int32_t values[] = {100, 200, 300, -400, -1, 2, 3, 4, 500, 0, 0, 1, 0, 0, 1638, -77};
    const drive_config_t *const drive = &commands.parameters.config.step.mixer.drive;

    for (int round = 0; round < 2; round++) /* written again they do not add up */
        for (uint8_t i = 0; i < 16; i++)
            TEST_ASSERT_EQUAL_UINT8(
                PARAMETERS_OK,
                parameter((uint8_t)(WIRE_PARAMETER_REQUEST_PARAMETER_LEFT_GAIN_CHOICE + i), true, values[i]).status);
    TEST_ASSERT_EQUAL_INT16(100, drive->left.gain_q15);
    TEST_ASSERT_EQUAL_INT16(-400, drive->left.offset_mv);
    TEST_ASSERT_EQUAL_INT16(-1, drive->right.gain_q15);
    TEST_ASSERT_EQUAL_INT16(500, drive->deadband_mv);
    TEST_ASSERT_UINT16_WITHIN(1, PARAMS_COUPLED.step.speed.count_travel_um_q2 * (1 + 1638 / 32768.0),
                              commands.parameters.config.step.speed.count_travel_um_q2);
    TEST_ASSERT_EQUAL_INT16(-77, commands.parameters.config.step.speed.count_mismatch_q15);
    TEST_ASSERT_TRUE(commands.parameters.config.step.mixer.battery_sags);
    loop.step.mode.mode = MODE_RUN;
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_BUSY,
                            parameter(WIRE_PARAMETER_REQUEST_PARAMETER_LEFT_GAIN_CHOICE, true, 1).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, parameter(WIRE_PARAMETER_REQUEST_PARAMETER_SPEED_KP_CHOICE, true, 1).status);
    loop.step.mode.mode = MODE_IDLE;
    commands.pending = MODE_START; /* it drives from the next step on */
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_BUSY,
                            parameter(WIRE_PARAMETER_REQUEST_PARAMETER_LEFT_GAIN_CHOICE, true, 1).status);
}

static void test_a_route_comes_into_force_at_once_or_not_at_all(void)
{
    upload_two();
    TEST_ASSERT_EQUAL_UINT8(0, commands.route.count);
    struct wire_route_t answer = commit(true, 2, check_of_two());
    TEST_ASSERT_EQUAL_UINT8(ROUTE_OK, answer.status);
    TEST_ASSERT_EQUAL_UINT8(2, answer.count);
    TEST_ASSERT_EQUAL_HEX16(check_of_two(), answer.route_check);
    waypoint(0, true, 7, 7);
    TEST_ASSERT_EQUAL_INT16(1000, waypoint(0, false, 0, 0).x);
    TEST_ASSERT_EQUAL_INT16(-1000, waypoint(0, false, 0, 0).y);
    TEST_ASSERT_EQUAL_INT16(500, commands.route.waypoints[1].y_mm);
    answer = commit(true, 2, 0x1234); /* the second waypoint has not been written again */
    TEST_ASSERT_EQUAL_UINT8(WIRE_ROUTE_STATUS_INCOMPLETE_CHOICE, answer.status);
    TEST_ASSERT_EQUAL_UINT8(2, answer.count);
    loop.step.mode.mode = MODE_RUN;
    TEST_ASSERT_EQUAL_UINT8(ROUTE_OK, commit(true, 2, check_of_two()).status); /* in force already */
}

static void test_a_route_that_cannot_be_flown_leaves_the_old_one(void)
{
    upload_two();
    commit(true, 2, check_of_two());
    upload_two();
    TEST_ASSERT_EQUAL_UINT8(WIRE_ROUTE_STATUS_DIFFERS_CHOICE, commit(true, 2, 0).status);
    TEST_ASSERT_EQUAL_UINT8(ROUTE_EMPTY, commit(true, 0, CRC_START).status);
    TEST_ASSERT_EQUAL_UINT8(ROUTE_TOO_LONG, commit(true, 33, 0).status);
    waypoint(1, true, 1000, -1000);
    static const uint8_t TWICE[] = {0xE8, 0x03, 0x18, 0xFC, 0xE8, 0x03, 0x18, 0xFC};
    TEST_ASSERT_EQUAL_UINT8(ROUTE_REPEATED, commit(true, 2, crc_of_bytes(CRC_START, TWICE, 8)).status);
    loop.step.mode.mode = MODE_RUN;
    upload_two();
    TEST_ASSERT_EQUAL_UINT8(WIRE_ROUTE_STATUS_BUSY_CHOICE, commit(true, 1, 0).status);
    TEST_ASSERT_EQUAL_UINT8(2, commit(false, 0, 0).count);
    TEST_ASSERT_EQUAL_HEX16(check_of_two(), commit(false, 0, 0).route_check);
}

static void test_a_waypoint_is_checked_when_written(void)
{
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, waypoint(31, true, 30000, -30000).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_UNKNOWN, waypoint(32, true, 0, 0).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, waypoint(0, true, 30001, 0).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, waypoint(0, true, 0, -32768).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_UNKNOWN, waypoint(0, false, 0, 0).status); /* no route in force */
}

static void test_a_mode_command_waits_for_the_next_step_and_acts_once(void)
{
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, command(MODE_START));
    TEST_ASSERT_EQUAL(MODE_START, commands_next(&commands));
    TEST_ASSERT_EQUAL(MODE_NONE, commands_next(&commands));
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, command(MODE_ABORT)); /* not in RUN */
    loop.step.mode.mode = MODE_RUN;
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, command(MODE_START));
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, command(MODE_RESET));
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, command(MODE_ABORT));
    loop.step.mode.mode = MODE_FAULT;
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, command(MODE_START));
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_UNKNOWN, command(MODE_NONE));
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_UNKNOWN, command(MODE_CUT_SILENT));
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_UNKNOWN, command(MODE_CUT_LATE));
    TEST_ASSERT_EQUAL(MODE_ABORT, commands_next(&commands));
}

static void test_serving_answers_one_request_and_a_session_stops_the_motors(void)
{
    sil_port_t port = {.left_q15 = 5};
    loop_state_t state = {.tick = 77, .silent_ms = 90};
    const struct wire_open_t open = sound_open();
    sil_bind(&port);
    commands_start(&commands);
    port.link_in[0] = (message_t){.id = WIRE_OPEN_FRAME_ID, .size = 8};
    wire_open_pack(port.link_in[0].data, &open, 8);
    crc_seal(&port.link_in[0]);
    port.link_in[1] = port.link_in[0];
    port.link_in[1].data[0] ^= 1; /* damaged */
    port.link_in_size = 2;
    serve(&commands, &state);
    TEST_ASSERT_EQUAL_UINT16(1, port.link_in_size); /* the other one waits */
    serve(&commands, &state);
    sil_bind(NULL);
    TEST_ASSERT_EQUAL_UINT16(1, port.link_out_size);
    TEST_ASSERT_EQUAL_UINT16(WIRE_HELLO_FRAME_ID, port.link_out[0].id);
    TEST_ASSERT_EQUAL_INT16(0, port.left_q15);
    TEST_ASSERT_EQUAL_UINT32(0, state.tick);
    TEST_ASSERT_EQUAL_UINT16(0, state.silent_ms);
}

static void test_serving_takes_a_sound_request_for_a_sign_of_life(void)
{
    sil_port_t port = {.left_q15 = 5};
    loop_state_t state = {.silent_ms = 90, .started = true};
    sil_bind(&port);
    port.link_in[0] = (message_t){.id = WIRE_ROUTE_REQUEST_FRAME_ID, .size = 8};
    crc_seal(&port.link_in[0]);
    port.link_in[0].data[0] ^= 1; /* damaged */
    port.link_in_size = 1;
    serve(&commands, &state);
    TEST_ASSERT_EQUAL_UINT16(90, state.silent_ms);
    crc_seal(&port.link_in[0]);
    port.link_in_size = 1;
    serve(&commands, &state);
    sil_bind(NULL);
    TEST_ASSERT_EQUAL_UINT16(0, state.silent_ms);
    TEST_ASSERT_EQUAL_INT16(5, port.left_q15);
}

static uint16_t write_route(uint8_t count)
{
    uint16_t check = CRC_START;
    for (uint8_t i = 0; i < count; i++) {
        const uint8_t bytes[] = {(uint8_t)(i + 1), 0, 0, 0};
        TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, waypoint(i, true, (int16_t)(i + 1), 0).status);
        check = crc_of_bytes(check, bytes, sizeof bytes);
    }
    return check;
}

static void test_a_route_has_up_to_32_waypoints_and_each_is_written_anew(void)
{
    const uint16_t check = write_route(32);
    TEST_ASSERT_EQUAL_UINT8(ROUTE_OK, commit(true, 32, check).status);
    TEST_ASSERT_EQUAL_INT16(32, waypoint(31, false, 0, 0).x);
    for (int i = 0; i < 2; i++) { /* either place, of which the last waypoint is not written again */
        TEST_ASSERT_EQUAL_UINT8(ROUTE_OK, commit(true, 31, write_route(31)).status);
        write_route(31);
        TEST_ASSERT_EQUAL_UINT8(WIRE_ROUTE_STATUS_INCOMPLETE_CHOICE, commit(true, 32, check).status);
    }
}

static void test_a_new_session_has_no_waypoint(void)
{
    static const uint8_t ZEROS[4] = {0};
    TEST_ASSERT_EQUAL_UINT8(WIRE_ROUTE_STATUS_INCOMPLETE_CHOICE,
                            commit(true, 1, crc_of_bytes(CRC_START, ZEROS, sizeof ZEROS)).status);
}

static void test_a_reply_tells_mode_and_fault_and_its_spare_bytes_are_0(void)
{
    struct wire_mode_reply_t answer;
    loop.step.mode.mode = MODE_FAULT;
    loop.step.mode.fault = MODE_COMMANDED;
    memset(request.data, 0xFF, sizeof request.data);
    TEST_ASSERT_TRUE(send(WIRE_MODE_COMMAND_FRAME_ID));
    wire_mode_reply_unpack(&answer, reply.data, 8);
    TEST_ASSERT_EQUAL_UINT8(MODE_FAULT, answer.mode);
    TEST_ASSERT_EQUAL_UINT8(MODE_COMMANDED, answer.fault);
    TEST_ASSERT_EQUAL_UINT8(0, reply.data[WIRE_MODE_REPLY_STATUS_AT + 1]);
    TEST_ASSERT_EQUAL_UINT8(0, reply.data[WIRE_MODE_REPLY_STATUS_AT + 2]);
    memset(request.data, 0xFF, sizeof request.data);
    TEST_ASSERT_TRUE(send(WIRE_ROUTE_REQUEST_FRAME_ID));
    TEST_ASSERT_EQUAL_UINT8(0, reply.data[WIRE_ROUTE_STATUS_AT + 1]);
    TEST_ASSERT_NOT_EQUAL_UINT8(0, reply.data[WIRE_ROUTE_STATUS_AT]);
}

static void test_a_time_is_more_than_0(void)
{
    const uint8_t timeout = WIRE_PARAMETER_REQUEST_PARAMETER_LEG_TIMEOUT_CHOICE;
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_OK, parameter(timeout, true, 1).status);
    TEST_ASSERT_EQUAL_UINT8(PARAMETERS_RANGE, parameter(timeout, true, 0).status);
    TEST_ASSERT_EQUAL_INT32(1, parameter(timeout, false, 0).value);
}

static void test_a_route_of_one_waypoint_in_force_is_confirmed_while_the_robot_drives(void)
{
    const uint16_t check = write_route(1);
    TEST_ASSERT_EQUAL_UINT8(ROUTE_OK, commit(true, 1, check).status);
    loop.step.mode.mode = MODE_RUN;
    TEST_ASSERT_EQUAL_UINT8(ROUTE_OK, commit(true, 1, check).status);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_open_says_who_is_there_and_what_differs);
    RUN_TEST(test_nothing_is_done_before_a_session_or_with_a_check_that_fails);
    RUN_TEST(test_every_parameter_is_read_and_written_within_its_range);
    RUN_TEST(test_a_gain_takes_effect_and_its_ends_are_inclusive);
    RUN_TEST(test_what_is_known_of_the_robot_is_written_setting_by_setting_and_not_while_it_drives);
    RUN_TEST(test_a_route_comes_into_force_at_once_or_not_at_all);
    RUN_TEST(test_a_route_that_cannot_be_flown_leaves_the_old_one);
    RUN_TEST(test_a_waypoint_is_checked_when_written);
    RUN_TEST(test_a_mode_command_waits_for_the_next_step_and_acts_once);
    RUN_TEST(test_serving_takes_a_sound_request_for_a_sign_of_life);
    RUN_TEST(test_serving_answers_one_request_and_a_session_stops_the_motors);
    RUN_TEST(test_a_route_has_up_to_32_waypoints_and_each_is_written_anew);
    RUN_TEST(test_a_new_session_has_no_waypoint);
    RUN_TEST(test_a_reply_tells_mode_and_fault_and_its_spare_bytes_are_0);
    RUN_TEST(test_a_time_is_more_than_0);
    RUN_TEST(test_a_route_of_one_waypoint_in_force_is_confirmed_while_the_robot_drives);
    return UNITY_END();
}
