#include <string.h>

#include "link/set.h"
#include "sets.h"
#include "unity.h"

static set_t set;
static sets_reading_t reading;
static message_t messages[SETS_MOST];
static int count;

void setUp(void)
{
    memset(&set, 0, sizeof set);
    reading = (sets_reading_t){.time_ms = 300,
                               .sequence = 7,
                               .imu = {1, -2, 3},
                               .rotation = {65535, 12},
                               .battery_mv = 8900,
                               .reference = {-5000000, 6000000, 40000, -123, 456}};
    count = sets_pack(&reading, messages);
}
void tearDown(void) {}

/* Hands over all but the message at `without`; returns the last status that is not SET_MORE. */
static set_status_t take_without(int without)
{
    set_status_t last = SET_MORE;
    for (int i = 0; i < count; i++)
        if (i != without) {
            const set_status_t status = set_take(&set, &messages[i]);
            last = status != SET_MORE ? status : last;
        }
    return last;
}
static set_status_t take_all(void)
{
    return take_without(-1);
}

static set_status_t take_at(uint32_t time_ms, uint8_t sequence)
{
    reading.time_ms = time_ms;
    reading.sequence = sequence;
    count = sets_pack(&reading, messages);
    return take_all();
}

static void test_set_is_taken_when_all_of_it_is_there(void)
{
    TEST_ASSERT_EQUAL_INT(7, count);
    TEST_ASSERT_EQUAL(SET_WHOLE, take_all());
    TEST_ASSERT_EQUAL_INT16(-2, set.imu.accel_sway_mm_s2);
    TEST_ASSERT_EQUAL_UINT16(65535, set.rotation.left);
    TEST_ASSERT_EQUAL_UINT16(8900, set.battery_mv);
    TEST_ASSERT_EQUAL_INT32(-5000000, set.reference.x_um);
    TEST_ASSERT_EQUAL_INT32(6000000, set.reference.y_um);
    TEST_ASSERT_EQUAL_UINT16(40000, set.reference.heading_bam16);
    TEST_ASSERT_EQUAL_INT16(-123, set.reference.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT16(456, set.reference.yaw_rate_mrad_s);
    TEST_ASSERT_EQUAL_UINT32(300, set.time_ms);
    TEST_ASSERT_EQUAL_UINT8(7, set.sequence);
}

static void test_set_that_lacks_any_message_is_not_taken_and_counted_with_the_next(void)
{
    for (int without = 0; without < 7; without++) {
        setUp();
        TEST_ASSERT_EQUAL(SET_MORE, take_without(without));
        TEST_ASSERT_FALSE(set.any);
        TEST_ASSERT_EQUAL(SET_WHOLE, take_at(303, 8));
        TEST_ASSERT_EQUAL_UINT16(without == 6 ? 0 : 1, set.incomplete);
    }
}

static void test_set_may_come_in_any_order_and_its_parts_twice(void)
{
    for (int i = count - 1; i > 0; i--)
        TEST_ASSERT_EQUAL(SET_MORE, set_take(&set, &messages[i]));
    TEST_ASSERT_EQUAL(SET_MORE, set_take(&set, &messages[3]));
    TEST_ASSERT_EQUAL(SET_WHOLE, set_take(&set, &messages[0]));
}

static void test_set_with_any_bit_turned_is_not_taken(void)
{
    for (int i = 0; i < 7; i++)
        for (int bit = 0; bit < 64; bit++) {
            setUp();
            messages[i].data[bit / 8] ^= (uint8_t)(1U << bit % 8);
            TEST_ASSERT_EQUAL(SET_MORE, take_all());
            TEST_ASSERT_FALSE(set.any);
            TEST_ASSERT_EQUAL(SET_WHOLE, take_at(303, 8));
        }
}

static void test_set_of_parts_from_two_sets_is_not_taken(void)
{
    message_t old = messages[0];
    reading.sequence = 8;
    reading.time_ms = 303;
    count = sets_pack(&reading, messages);
    messages[0] = old;
    TEST_ASSERT_EQUAL(SET_MORE, take_all());
}

static void test_set_older_than_the_newest_is_refused_and_counted(void)
{
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(300, 1));
    TEST_ASSERT_EQUAL(SET_MORE, take_at(297, 2));
    TEST_ASSERT_EQUAL_UINT16(1, set.stale);
    TEST_ASSERT_EQUAL_UINT32(300, set.time_ms);
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(303, 3));
}

static void test_sets_of_a_plant_that_has_begun_anew_are_refused_for_good(void)
{
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(300, 1));
    for (uint8_t i = 0; i < SET_STALE_MOST - 1; i++)
        TEST_ASSERT_EQUAL(SET_MORE, take_at(3U * i, i));
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(303, 2)); /* latecomers, after all */
    for (uint8_t i = 0; i < SET_STALE_MOST; i++)
        TEST_ASSERT_EQUAL(SET_MORE, take_at(3U * i, i));
    TEST_ASSERT_EQUAL(SET_MORE, take_at(303, 3));
    TEST_ASSERT_EQUAL(SET_MORE, take_at(306, 4));
    memset(&set, 0, sizeof set);
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(3, 1));
}

static void test_set_sent_again_is_told_from_a_new_one(void)
{
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(300, 1));
    TEST_ASSERT_EQUAL(SET_AGAIN, take_at(300, 2));
    TEST_ASSERT_EQUAL_UINT8(2, set.sequence);
}

static void test_set_order_survives_a_clock_that_wraps(void)
{
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(UINT32_MAX - 1, 1));
    TEST_ASSERT_EQUAL(SET_WHOLE, take_at(1, 2));
    TEST_ASSERT_EQUAL(SET_MORE, take_at(UINT32_MAX - 1, 3));
}

static void test_set_without_sensors_is_still_a_set(void)
{
    reading.imu_status = HAL_ABSENT;
    reading.rotation_status = reading.battery_status = reading.reference_status = HAL_STALE;
    count = sets_pack(&reading, messages);
    TEST_ASSERT_EQUAL_INT(1, count);
    TEST_ASSERT_EQUAL(SET_WHOLE, take_all());
    TEST_ASSERT_EQUAL(HAL_ABSENT, set.imu_status);
    TEST_ASSERT_EQUAL(HAL_STALE, set.reference_status);
}

static void test_set_refuses_messages_of_another_size_and_a_status_that_is_none(void)
{
    messages[0].size = 7;
    TEST_ASSERT_EQUAL(SET_MORE, take_all());
    TEST_ASSERT_EQUAL_UINT16(1, set.bad);
    setUp();
    reading.imu_status = (hal_status_t)3;
    count = sets_pack(&reading, messages);
    TEST_ASSERT_EQUAL(SET_MORE, take_all());
    TEST_ASSERT_EQUAL_UINT16(1, set.bad);
}

static void test_set_leaves_other_messages_alone(void)
{
    const message_t other = {.id = WIRE_MODE_COMMAND_FRAME_ID, .size = 8};
    TEST_ASSERT_EQUAL(SET_OTHER, set_take(&set, &other));
}

static void test_set_counts_do_not_wrap(void)
{
    set.bad = 65535;
    set_count_bad(&set);
    TEST_ASSERT_EQUAL_UINT16(65535, set.bad);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_set_is_taken_when_all_of_it_is_there);
    RUN_TEST(test_set_that_lacks_any_message_is_not_taken_and_counted_with_the_next);
    RUN_TEST(test_set_may_come_in_any_order_and_its_parts_twice);
    RUN_TEST(test_set_with_any_bit_turned_is_not_taken);
    RUN_TEST(test_set_of_parts_from_two_sets_is_not_taken);
    RUN_TEST(test_set_older_than_the_newest_is_refused_and_counted);
    RUN_TEST(test_sets_of_a_plant_that_has_begun_anew_are_refused_for_good);
    RUN_TEST(test_set_sent_again_is_told_from_a_new_one);
    RUN_TEST(test_set_order_survives_a_clock_that_wraps);
    RUN_TEST(test_set_without_sensors_is_still_a_set);
    RUN_TEST(test_set_refuses_messages_of_another_size_and_a_status_that_is_none);
    RUN_TEST(test_set_leaves_other_messages_alone);
    RUN_TEST(test_set_counts_do_not_wrap);
    return UNITY_END();
}
