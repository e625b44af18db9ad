#include <string.h>

#include "unity.h"
#include "wire/crc.h"
#include "wire/frame.h"

/* Bytes are compared with Python's cobs and binascii in tests/python/test_hil_wire.py. */
static const message_t MESSAGE = {.id = 0x123, .size = 8, .data = {0, 1, 2, 0, 0, 255, 7, 0}};
static frame_decoder_t decoder;
static message_t got;

void setUp(void)
{
    memset(&decoder, 0, sizeof decoder);
    memset(&got, 0, sizeof got);
}
void tearDown(void) {}

/* The status at the last byte. */
static frame_status_t take(const uint8_t *bytes, int size)
{
    frame_status_t status = FRAME_MORE;
    for (int i = 0; i < size; i++)
        status = frame_take(&decoder, bytes[i], &got);
    return status;
}

static void test_crc_has_the_catalogued_check_value(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x29B1, crc_of_bytes(CRC_START, (const uint8_t *)"123456789", 9));
    TEST_ASSERT_EQUAL_HEX16(CRC_START, crc_of_bytes(CRC_START, NULL, 0));
}

static void test_seal_holds_and_breaks_with_any_bit(void)
{
    message_t message = MESSAGE;
    crc_seal(&message);
    TEST_ASSERT_TRUE(crc_holds(&message));
    for (int bit = 0; bit < 64; bit++) {
        message.data[bit / 8] ^= (uint8_t)(1U << bit % 8);
        TEST_ASSERT_FALSE(crc_holds(&message));
        message.data[bit / 8] ^= (uint8_t)(1U << bit % 8);
    }
    message.id++;
    TEST_ASSERT_FALSE(crc_holds(&message));
}

static void test_frame_comes_back_whole_at_every_size(void)
{
    for (uint8_t size = 0; size <= MESSAGE_DATA_MAX; size++) {
        uint8_t bytes[FRAME_SIZE_MAX];
        message_t message = MESSAGE;
        message.size = size;
        const uint8_t count = frame_encode(&message, bytes);
        TEST_ASSERT_EQUAL_UINT8(size + 7, count);
        TEST_ASSERT_NULL(memchr(bytes, 0, count - 1U));
        TEST_ASSERT_EQUAL(FRAME_MESSAGE, take(bytes, count));
        TEST_ASSERT_EQUAL_HEX16(0x123, got.id);
        TEST_ASSERT_EQUAL_UINT8(size, got.size);
        TEST_ASSERT_EQUAL_INT(0, memcmp(MESSAGE.data, got.data, size));
    }
}

static void test_frame_with_any_bit_turned_is_refused(void)
{
    uint8_t bytes[FRAME_SIZE_MAX];
    const uint8_t count = frame_encode(&MESSAGE, bytes);
    for (int bit = 0; bit < 8 * count; bit++) {
        frame_status_t status;
        bool taken = false;
        bytes[bit / 8] ^= (uint8_t)(1U << bit % 8);
        for (int i = 0; i < count; i++) {
            status = frame_take(&decoder, bytes[i], &got);
            taken = taken || status == FRAME_MESSAGE;
        }
        TEST_ASSERT_FALSE(taken);
        frame_take(&decoder, 0, &got);
        bytes[bit / 8] ^= (uint8_t)(1U << bit % 8);
    }
    TEST_ASSERT_EQUAL(FRAME_MESSAGE, take(bytes, count));
}

static void test_frame_reader_is_in_step_again_after_rubbish(void)
{
    uint8_t bytes[FRAME_SIZE_MAX];
    const uint8_t count = frame_encode(&MESSAGE, bytes);
    for (int length = 1; length < 60; length++) {
        for (int i = 0; i < length; i++)
            TEST_ASSERT_EQUAL(FRAME_MORE, frame_take(&decoder, (uint8_t)(i * 37 % 255 + 1), &got));
        TEST_ASSERT_EQUAL(FRAME_BAD, frame_take(&decoder, 0, &got));
        TEST_ASSERT_EQUAL(FRAME_MESSAGE, take(bytes, count));
    }
}

static void test_frame_reader_takes_empty_frames_for_nothing(void)
{
    static const uint8_t ENDS[] = {0, 0, 0};
    TEST_ASSERT_EQUAL(FRAME_MORE, take(ENDS, 3));
}

static void test_frame_with_an_id_beyond_eleven_bits_is_refused(void)
{
    uint8_t bytes[FRAME_SIZE_MAX];
    const message_t message = {.id = 0x800, .size = 1};
    TEST_ASSERT_EQUAL(FRAME_BAD, take(bytes, frame_encode(&message, bytes)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_crc_has_the_catalogued_check_value);
    RUN_TEST(test_seal_holds_and_breaks_with_any_bit);
    RUN_TEST(test_frame_comes_back_whole_at_every_size);
    RUN_TEST(test_frame_with_any_bit_turned_is_refused);
    RUN_TEST(test_frame_reader_is_in_step_again_after_rubbish);
    RUN_TEST(test_frame_reader_takes_empty_frames_for_nothing);
    RUN_TEST(test_frame_with_an_id_beyond_eleven_bits_is_refused);
    return UNITY_END();
}
