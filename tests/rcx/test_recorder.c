/* test_recorder.c: the recorder beside the real kernel. Prints every packet of its replies, for the host's side of the
 * test. */
#include <stddef.h>

#include <unistd.h>

#include "unity.h"

enum { STACK = 256, LAST_BLOCK = 87, PACKET_MOST = 110, PORT = 7 };

int program_main(int argc, char **argv);

void setUp(void) {}
void tearDown(void) {}

static uint8_t ask(uint16_t number, uint8_t *packet)
{
    uint8_t request[] = {0xF1, 4, PORT, 0x87, (uint8_t)number, (uint8_t)(number >> 8), 0xFF};

    for (uint8_t i = 0; i < sizeof request - 1; i++)
        request[sizeof request - 1] = (uint8_t)(request[sizeof request - 1] + request[i]);
    world_send(request, sizeof request);
    return world_receive(packet, PACKET_MOST);
}

static void print(const uint8_t *bytes, uint8_t size)
{
    static const char digits[] = "0123456789abcdef";
    char text[2 * PACKET_MOST + 2];
    uint8_t at = 0;

    for (uint8_t i = 0; i < size; i++) {
        text[at++] = digits[bytes[i] >> 4];
        text[at++] = digits[bytes[i] & 15];
    }
    text[at++] = '\n';
    text[at] = '\0';
    world_say(text);
}

/* The inputs follow the motors, so that the samples show whether inputs and motors match. */
static void test_recorder_drives_and_keeps_what_the_sensors_say(void)
{
    uint8_t packet[PACKET_MOST];
    int16_t a = 0, c = 0;

    world_convert(0, 319);
    for (uint8_t input = 1; input <= 3; input++)
        world_convert(input, 512);
    (void)execi(&program_main, 0, NULL, PRIO_NORMAL, STACK);
    for (uint16_t ms = 0; ms < 17000; ms += 100) {
        world_run(100);
        TEST_ASSERT_EQUAL_UINT8(0, ms == 8000 ? ask(0, packet) : 0); /* no answer while the robot drives */
        world_pulses(&a, &c);
        world_convert(2, (uint16_t)(512 + (a - c) / 4));
        world_convert(1, (uint16_t)(512 + (a + c) / 4));
    }
    world_run(500);
    world_pulses(&a, &c);
    TEST_ASSERT_EQUAL_INT16(0, a);
    TEST_ASSERT_EQUAL_INT16(0, c);
}

static void test_recorder_answers_block_by_block(void)
{
    uint8_t packet[PACKET_MOST];
    uint8_t size;

    for (uint16_t number = 0; number <= LAST_BLOCK; number++) {
        size = ask(number, packet);
        TEST_ASSERT_TRUE(size > 0);
        print(packet, size);
    }
    TEST_ASSERT_EQUAL_UINT8(7, size); /* beyond the end: only the number */
    size = ask(1, packet);
    TEST_ASSERT_EQUAL_UINT8(107, size);
}

int world_main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_recorder_drives_and_keeps_what_the_sensors_say);
    RUN_TEST(test_recorder_answers_block_by_block);
    return UNITY_END();
}
