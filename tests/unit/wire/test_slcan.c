#include <string.h>

#include "unity.h"
#include "wire/slcan.h"

static slcan_decoder_t decoder;
static message_t got;

void setUp(void)
{
    memset(&decoder, 0, sizeof decoder);
    memset(&got, 0, sizeof got);
}
void tearDown(void) {}

static slcan_status_t take(const char *text)
{
    slcan_status_t status = SLCAN_MORE;
    for (; *text != 0; text++)
        status = slcan_take(&decoder, (uint8_t)*text, &got);
    return status;
}

static void answers(const char *text, const char *reply)
{
    TEST_ASSERT_EQUAL(SLCAN_REPLY, take(text));
    TEST_ASSERT_EQUAL_UINT8(strlen(reply), decoder.reply_size);
    TEST_ASSERT_EQUAL_MEMORY(reply, decoder.reply, strlen(reply));
}

static void test_slcan_line_is_the_one_that_adapters_write(void)
{
    const message_t message = {.id = 0x12A, .size = 3, .data = {0x00, 0xFF, 0x5C}};
    uint8_t bytes[SLCAN_SIZE_MAX];
    TEST_ASSERT_EQUAL_UINT8(12, slcan_encode(&message, bytes));
    TEST_ASSERT_EQUAL_MEMORY("t12A300FF5C\r", bytes, 12);
}

static void test_slcan_takes_a_frame_once_open_in_either_case(void)
{
    answers("t12A1FF\r", "\a");
    answers("O\r", "\r");
    TEST_ASSERT_EQUAL(SLCAN_MESSAGE, take("t12a300fF5C\r"));
    TEST_ASSERT_EQUAL_HEX16(0x12A, got.id);
    TEST_ASSERT_EQUAL_UINT8(3, got.size);
    TEST_ASSERT_EQUAL_HEX8(0xFF, got.data[1]);
    TEST_ASSERT_EQUAL(SLCAN_MESSAGE, take("t7FF0\r"));
    answers("C\r", "\r");
    answers("t12A1FF\r", "\a");
}

static void test_slcan_bears_how_python_can_opens_a_channel(void)
{
    take("C\rS6\r\rO\rO\r");
    TEST_ASSERT_TRUE(decoder.open);
}

static void test_slcan_tells_who_it_is(void)
{
    answers("V\r", "V0101\r");
    answers("N\r", "N0001\r");
}

static void test_slcan_refuses_what_is_no_frame(void)
{
    static const char *const WRONG[] = {
        "t80000\r", "t12A9\r", "t12A2FF\r",  "t12A1FFF\r", "t12A1FG\r", "t1\r",      "T0000012\r",
        "S9\r",     "hello\r", "t12A 1FF\r", "O1\r",       "r1230\r",   "t12A1-1\r", "t12AA0000000000000000000000\r"};
    take("O\r");
    for (size_t i = 0; i < sizeof WRONG / sizeof *WRONG; i++)
        answers(WRONG[i], "\a");
    TEST_ASSERT_TRUE(decoder.open);
    TEST_ASSERT_EQUAL(SLCAN_MESSAGE, take("t12A1FF\r"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_slcan_line_is_the_one_that_adapters_write);
    RUN_TEST(test_slcan_takes_a_frame_once_open_in_either_case);
    RUN_TEST(test_slcan_bears_how_python_can_opens_a_channel);
    RUN_TEST(test_slcan_tells_who_it_is);
    RUN_TEST(test_slcan_refuses_what_is_no_frame);
    return UNITY_END();
}
