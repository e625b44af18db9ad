/* test_port.c: what the drivers of hal/rcx do beyond the contract of every port, beside brickOS's own kernel. */
#include <stddef.h>

#include <conio.h>
#include <dmotor.h>
#include <unistd.h>

#include "app/serve.h"
#include "port.h"
#include "port_rcx.h"
#include "rcx/infrared.h"
#include "targets/rcx/panel.h"
#include "unity.h"
#include "wire/crc.h"
#include "wire/codecs_gen.h"

enum { DISPLAY_SIZE = 9 };

extern volatile uint8_t motor_controller;
extern uint8_t display_memory[DISPLAY_SIZE];

static commands_t commands;
static loop_state_t state;
static uint8_t asked; /* sequence of requests */

void setUp(void)
{
    port_begin();
}
void tearDown(void)
{
    port_end();
}

/* serve() calls it; the rest of the loop is not in this program. */
void loop_heard(loop_state_t *heard)
{
    heard->silent_ms = 0;
}

static void test_port_room_for_a_program(void)
{
    world_say("largest block ");
    world_say_number(world_room);
    world_say("\n");
    TEST_ASSERT_TRUE(world_room > 14000);
}

static void test_port_motors_are_symmetric_and_grow_with_duty(void)
{
    int16_t a, c, mirrored_a, mirrored_c, before = 0;

    for (int16_t duty = 128; duty > 0 && duty <= 32640; duty += 2032) {
        hal_motors_write(duty, (int16_t)-duty);
        world_pulses(&a, &c);
        hal_motors_write((int16_t)-duty, duty);
        world_pulses(&mirrored_a, &mirrored_c);
        TEST_ASSERT_EQUAL_INT16(a, -c);
        TEST_ASSERT_EQUAL_INT16(a, -mirrored_a);
        TEST_ASSERT_EQUAL_INT16(a, mirrored_c);
        TEST_ASSERT_TRUE(a > before);
        before = a;
    }
}

static void test_port_zero_duty_shorts_the_motors_and_pulses_float_between(void)
{
    bool floats = false;

    hal_motors_write(0, 0);
    for (uint16_t ms = 0; ms < 256; ms++) {
        world_run(1);
        TEST_ASSERT_EQUAL_UINT8(0xC3, motor_controller);
    }
    hal_motors_write(10923, -10923);
    for (uint8_t ms = 0; ms < 8; ms++) {
        world_run(1);
        floats = floats || motor_controller == 0;
    }
    TEST_ASSERT_TRUE(floats);
    hal_motors_write(0, 0);
}

static void test_port_gyro_reads_nothing_at_the_rails_and_mirrors_about_its_middle(void)
{
    hal_imu_t above, below;

    for (uint8_t input = 1; input <= 3; input++)
        world_convert(input, 512);
    TEST_ASSERT_TRUE(hal_imu_read(&above) != HAL_STALE);
    TEST_ASSERT_EQUAL_INT16(0, above.yaw_rate_mrad_s);
    world_convert(2, 0);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&above));
    world_convert(2, 1023);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&above));
    world_convert(2, 513);
    TEST_ASSERT_TRUE(hal_imu_read(&above) != HAL_STALE);
    TEST_ASSERT_EQUAL_INT16(20, above.yaw_rate_mrad_s);
    world_convert(2, 1022);
    (void)hal_imu_read(&above);
    TEST_ASSERT_EQUAL_INT16(10429, above.yaw_rate_mrad_s); /* 510 counts of 600 degrees/s / 512 */
    world_convert(2, 2);
    (void)hal_imu_read(&below);
    TEST_ASSERT_EQUAL_INT16(-10429, below.yaw_rate_mrad_s);
}

#ifdef RCX_ROTATION
/* A LEGO rotation sensor goes through four voltages, of which each step is a count. */
static void test_port_rotation_counts_as_brickos_does(void)
{
    static const uint16_t forward[] = {960, 832, 384, 576}; /* in the middle of what brickOS takes for one */
    hal_rotation_t before, after;

    world_convert(1, forward[0]);
    world_convert(3, forward[0]);
    world_converted();
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&before));
    for (uint8_t i = 1; i <= 9; i++) {
        world_convert(1, forward[i % 4]);
        world_convert(3, forward[-i & 3]);
        world_converted();
    }
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&after));
    TEST_ASSERT_EQUAL_UINT16((uint16_t)(before.left + 9), after.left);
    TEST_ASSERT_EQUAL_UINT16((uint16_t)(before.right - 9), after.right);
}
#endif

#ifndef RCX_ROTATION
static void test_port_accelerometer_reads_nothing_at_the_rails_and_mirrors_about_its_middle(void)
{
    hal_imu_t imu;

    world_convert(2, 512);
    world_convert(1, 1022);
    world_convert(3, 2);
    TEST_ASSERT_EQUAL(HAL_OK, hal_imu_read(&imu));
    TEST_ASSERT_EQUAL_INT16(19543, imu.accel_surge_mm_s2); /* 510 counts of 2 g / 512 */
    TEST_ASSERT_EQUAL_INT16(-19543, imu.accel_sway_mm_s2);
    world_convert(3, 1023);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&imu));
    world_convert(3, 512);
    world_convert(1, 0);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&imu));
}
#endif

/* Against 43988 / 1560 added up once more, up all of the range and down again. */
static void test_port_battery_follows_brickos_formula(void)
{
    uint16_t mv = 0, over = 0, read;

    for (uint16_t raw = 1; raw <= 709; raw++) { /* 20 V */
        over = (uint16_t)(over + 43988U % 1560U);
        mv = (uint16_t)(mv + 43988U / 1560U + (over >= 1560 ? 1 : 0));
        over = over >= 1560 ? (uint16_t)(over - 1560) : over;
        world_convert(0, raw);
        TEST_ASSERT_EQUAL(HAL_OK, hal_battery_read(&read));
        TEST_ASSERT_EQUAL_UINT16(mv, read);
    }
    world_convert(0, 1);
    TEST_ASSERT_EQUAL(HAL_OK, hal_battery_read(&read));
    TEST_ASSERT_EQUAL_UINT16(28, read);
    world_convert(0, 319);
    (void)hal_battery_read(&read);
    TEST_ASSERT_EQUAL_UINT16(8994, read);
}

static void test_port_buttons_count_once_however_they_bounce(void)
{
    world_press(KEY_RUN);
    world_run(150);
    (void)panel_pressed();
    world_press(0);
    world_run(150);
    TEST_ASSERT_EQUAL_UINT8(0, panel_pressed());
    for (uint8_t bounce = 0; bounce < 5; bounce++) {
        world_press(KEY_VIEW);
        world_run(2);
        world_press(0);
        world_run(1);
    }
    world_press(KEY_VIEW);
    TEST_ASSERT_EQUAL_UINT8(PANEL_VIEW, panel_pressed());
    world_run(300);
    TEST_ASSERT_EQUAL_UINT8(0, panel_pressed());
    world_press(KEY_VIEW | KEY_PRGM);
    world_run(150);
    TEST_ASSERT_EQUAL_UINT8(PANEL_PRGM, panel_pressed());
    world_press(KEY_RUN);
    world_run(150);
    TEST_ASSERT_EQUAL_UINT8(0, panel_pressed());
    world_press(0);
    world_run(150);
}

static void shows(const char *text)
{
    uint8_t shown[DISPLAY_SIZE];

    for (uint8_t i = 0; i < DISPLAY_SIZE; i++)
        shown[i] = display_memory[i];
    cputs((char *)text);
    TEST_ASSERT_EQUAL_MEMORY(display_memory, shown, DISPLAY_SIZE);
}

static void test_port_display_tells_mode_and_waypoint(void)
{
    mode_state_t mode = {.mode = MODE_IDLE};

    panel_show(&mode, true);
    shows("rESt");
    panel_show(&mode, false);
    shows("idLE");
    mode.mode = MODE_RUN;
    panel_show(&mode, false);
    shows("run 1");
    mode.los.waypoint = 11;
    panel_show(&mode, false);
    shows("run12");
    mode.mode = MODE_FAULT;
    mode.fault = MODE_STATE_LOST;
    panel_show(&mode, false);
    shows("Err 3");
    mode.fault = MODE_LATE; /* not that of Prgm, which is 4 */
    panel_show(&mode, false);
    shows("Err 7");
    mode.mode = MODE_ARRIVED;
    panel_show(&mode, false);
    shows("donE");
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
    port_host_repeat(); /* what was lost is no repetition */
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
    TEST_ASSERT_EQUAL_UINT8(1, got.data[WIRE_FAULTS_BAD_AT]); /* of the tests above */
    TEST_ASSERT_EQUAL_UINT8(0, got.data[WIRE_FAULTS_INCOMPLETE_AT]);
    TEST_ASSERT_EQUAL_UINT8(2, got.data[WIRE_FAULTS_STALE_AT]);
    TEST_ASSERT_EQUAL_UINT8(3, got.data[WIRE_FAULTS_LOST_AT]);
    world_run(10); /* the kernel notices that it is out */
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

int world_main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_port_room_for_a_program);
    RUN_TEST(test_port_motors_are_symmetric_and_grow_with_duty);
    RUN_TEST(test_port_zero_duty_shorts_the_motors_and_pulses_float_between);
    RUN_TEST(test_port_gyro_reads_nothing_at_the_rails_and_mirrors_about_its_middle);
#ifndef RCX_ROTATION
    RUN_TEST(test_port_accelerometer_reads_nothing_at_the_rails_and_mirrors_about_its_middle);
#endif
#ifdef RCX_ROTATION
    RUN_TEST(test_port_rotation_counts_as_brickos_does);
#endif
    RUN_TEST(test_port_battery_follows_brickos_formula);
    RUN_TEST(test_port_buttons_count_once_however_they_bounce);
    RUN_TEST(test_port_display_tells_mode_and_waypoint);
    RUN_TEST(test_port_a_setting_changes_over_the_air);
    RUN_TEST(test_port_a_route_changes_over_the_air);
    RUN_TEST(test_port_a_repetition_is_answered_again_and_not_obeyed);
    RUN_TEST(test_port_what_finds_no_room_is_counted);
    RUN_TEST(test_port_what_is_no_message_is_left_out);
    RUN_TEST(test_port_faults_follow_a_heartbeat);
    RUN_TEST(test_port_a_collision_costs_one_message);
    return UNITY_END();
}
