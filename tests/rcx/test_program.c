/* test_program.c: the whole program, as the button Run starts it, beside the real kernel: buttons, display, link, and
 * its end. The world does not move: the robot measures that it stands still.
 */
#include <stddef.h>

#include <conio.h>
#include <stdlib.h>
#include <sys/mm.h>
#include <sys/tm.h>
#include <unistd.h>

#include "app/commands.h"
#include "port.h"
#include "port_rcx.h"
#include "unity.h"
#include "wire/crc.h"
#include "wire/codecs_gen.h"

enum { DISPLAY_SIZE = 9, STACK = 344, INTERRUPTS = 160, LEVEL = 512, NINE_VOLTS = 319, OPEN = 1023, PAINT = 0xA5 };

extern uint8_t display_memory[DISPLAY_SIZE];
void mm_defrag(void);
int program_main(int argc, char **argv);

static uint8_t asked;
static uint8_t *stack; /* stack of the control loop, filled with PAINT */

void setUp(void) {}
void tearDown(void) {}

static void level(void)
{
    world_convert(0, NINE_VOLTS);
    for (uint8_t input = 1; input <= 3; input++)
        world_convert(input, LEVEL);
}

static void shows(const char *text)
{
    static const uint8_t arrows[DISPLAY_SIZE] = {0, 0x04, 0x40, 0x44, 0x44}; /* the motors' arrows */
    uint8_t shown[DISPLAY_SIZE], wanted[DISPLAY_SIZE];

    for (uint8_t i = 0; i < DISPLAY_SIZE; i++)
        shown[i] = display_memory[i];
    cputs("     "); /* cls() leaves the last digit */
    cputs((char *)text);
    for (uint8_t i = 0; i < DISPLAY_SIZE; i++) {
        wanted[i] = display_memory[i];
        display_memory[i] = shown[i];
        wanted[i] = (uint8_t)(wanted[i] & ~arrows[i]);
        shown[i] = (uint8_t)(shown[i] & ~arrows[i]);
    }
    TEST_ASSERT_EQUAL_MEMORY(wanted, shown, DISPLAY_SIZE);
}

static bool drives(void)
{
    int16_t a, c;

    world_pulses(&a, &c);
    return a != 0 || c != 0;
}

static void press(uint8_t key)
{
    world_press(key);
    world_run(150);
    world_press(0);
    world_run(150);
}

static void test_program_rests_then_flies_its_own_route(void)
{
    level();
    world_press(0);
    stack = (uint8_t *)((tdata_t *)execi(&program_main, 0, NULL, PRIO_NORMAL, STACK))->stack_base;
    for (uint16_t i = 0; i < STACK - 64; i++) /* a task's first data lie at the top */
        stack[i] = PAINT;
    world_run(1900);
    shows("rESt");
    TEST_ASSERT_FALSE(drives());
    world_run(400);
    shows("run 1");
    TEST_ASSERT_TRUE(drives());
}

static void test_program_prgm_stops_and_resets(void)
{
    press(KEY_PRGM);
    shows("Err 4");
    TEST_ASSERT_FALSE(drives());
    press(KEY_PRGM);
    shows("idLE");
    world_run(2500);
    shows("idLE");
}

static void test_program_view_starts_again(void)
{
    press(KEY_VIEW);
    shows("rESt");
    TEST_ASSERT_FALSE(drives());
    world_run(2000);
    shows("run 1");
    TEST_ASSERT_TRUE(drives());
}

static void test_program_stops_without_its_gyro(void)
{
    world_convert(2, OPEN);
    world_run(400);
    shows("Err 3");
    TEST_ASSERT_FALSE(drives());
    level();
    world_run(400);
    shows("Err 3");
}

static void test_program_leaves_most_of_the_link_to_the_host(void)
{
    message_t got;
    uint8_t heartbeats = 0, records = 0, parts = 0;

    world_forget();
    for (uint16_t ms = 0; ms < 6500; ms += 250) {
        world_run(250);
        while (world_waits() && port_host_receive(&got)) {
            heartbeats = (uint8_t)(heartbeats + (got.id == WIRE_HEARTBEAT_FRAME_ID));
            records = (uint8_t)(records + (got.id == WIRE_TELEMETRY_X_FRAME_ID));
            parts = (uint8_t)(parts + (got.id >= WIRE_TELEMETRY_X_FRAME_ID));
        }
    }
    TEST_ASSERT_TRUE(heartbeats >= 1 && heartbeats <= 3);
    TEST_ASSERT_TRUE(records >= 2 && records <= 4);
    TEST_ASSERT_TRUE(parts >= 7 * (records - 1));
}

/* Does the host's part of the link: both ends cannot send at once, so the host asks again until it gets an answer. */
static void ask(message_t *request, uint16_t wanted, message_t *answer)
{
    request->size = 8;
    request->data[0] = asked++;
    crc_seal(request);
    while (port_host_receive(answer)) {
    }
    (void)port_host_send(request);
    for (uint8_t tries = 0; tries < 20; tries++) {
        if (!port_host_receive(answer))
            port_host_repeat();
        else if (answer->id == wanted)
            return;
    }
    TEST_ASSERT_TRUE(false);
}

static void test_program_obeys_a_host(void)
{
    static const uint8_t coordinates[] = {0xE8, 0x03, 0x00, 0x00}; /* 1000, 0 */
    const uint16_t check = crc_of_bytes(CRC_START, coordinates, sizeof coordinates);
    message_t open = {.id = WIRE_OPEN_FRAME_ID}, waypoint = {.id = WIRE_WAYPOINT_REQUEST_FRAME_ID};
    message_t route = {.id = WIRE_ROUTE_REQUEST_FRAME_ID}, start = {.id = WIRE_MODE_COMMAND_FRAME_ID}, answer;
    int16_t a, c;

    open.data[1] = WIRE_PROTOCOL;
    open.data[2] = (uint8_t)WIRE_DBC;
    open.data[3] = (uint8_t)(WIRE_DBC >> 8);
    open.data[5] = WIRE_OPEN_PACE_REALTIME_CHOICE;
    press(KEY_VIEW);
    shows("rESt"); /* without the session it would start now */
    ask(&open, WIRE_HELLO_FRAME_ID, &answer);
    TEST_ASSERT_EQUAL_UINT8(WIRE_HELLO_STATUS_OK_CHOICE, answer.data[5]);
    shows("idLE");
    waypoint.data[1] = 0x40;
    for (uint8_t i = 0; i < sizeof coordinates; i++)
        waypoint.data[2 + i] = coordinates[i];
    ask(&waypoint, WIRE_WAYPOINT_FRAME_ID, &answer);
    route.data[1] = 0x40 | 1;
    route.data[2] = (uint8_t)check;
    route.data[3] = (uint8_t)(check >> 8);
    ask(&route, WIRE_ROUTE_FRAME_ID, &answer);
    TEST_ASSERT_EQUAL_UINT8(0, answer.data[4]);
    world_run(2500);
    shows("idLE"); /* the robot does not start by itself */
    start.data[1] = MODE_START;
    ask(&start, WIRE_MODE_REPLY_FRAME_ID, &answer);
    world_run(100);
    shows("run 1");
    world_pulses(&a, &c);
    TEST_ASSERT_TRUE(a > 0 && c > 0);
    TEST_ASSERT_TRUE(a - c < 8 && c - a < 8); /* straight ahead */
}

static void test_program_stack_leaves_room_for_interrupts(void)
{
    uint16_t left = 0;

    while (stack[left] == PAINT)
        left++;
    world_say("stack ");
    world_say_number(STACK - left);
    world_say("\n");
    TEST_ASSERT_TRUE(left >= INTERRUPTS);
}

static void test_program_ends_when_the_kernel_asks(void)
{
    const unsigned tasks = nb_tasks;

    shutdown_tasks(T_KERNEL | T_USER); /* by address both tasks of the program count as the kernel's here */
    world_run(600);
    TEST_ASSERT_EQUAL_UINT16(tasks - 2, nb_tasks);
    TEST_ASSERT_FALSE(drives());
}

int world_main(void)
{
    const int free_before = mm_free_mem();

    UNITY_BEGIN();
    RUN_TEST(test_program_rests_then_flies_its_own_route);
    RUN_TEST(test_program_prgm_stops_and_resets);
    RUN_TEST(test_program_view_starts_again);
    RUN_TEST(test_program_stops_without_its_gyro);
    RUN_TEST(test_program_leaves_most_of_the_link_to_the_host);
    RUN_TEST(test_program_obeys_a_host);
    RUN_TEST(test_program_stack_leaves_room_for_interrupts);
    RUN_TEST(test_program_ends_when_the_kernel_asks);
    mm_defrag();
    UNITY_CHECK(mm_free_mem() == free_before);
    return UNITY_END();
}
