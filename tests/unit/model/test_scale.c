#include "model/scale.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static void test_scale_multiplies_by_mantissa_over_two_to_the_15_and_shift(void)
{
    const scale_t three_quarters = {24576, 0}, tiny = {24576, 13};
    TEST_ASSERT_EQUAL_INT32(750000, scale_apply(&three_quarters, 1000000));
    TEST_ASSERT_EQUAL_INT32(92, scale_apply(&tiny, 1000000));
}

static void test_scale_takes_the_largest_values(void)
{
    const scale_t most = {32767, 0};
    TEST_ASSERT_EQUAL_INT32(2147418111, scale_apply(&most, INT32_MAX));
    TEST_ASSERT_EQUAL_INT32(-2147418112, scale_apply(&most, INT32_MIN));
    TEST_ASSERT_EQUAL_INT32(1073676289, scale_apply16(&most, 32767));
}

static void test_scale_rounds_to_the_nearest_on_both_sides(void)
{
    const scale_t half = {16384, 0}, minus_half = {-16384, 0};
    TEST_ASSERT_EQUAL_INT32(4, scale_apply(&half, 7));
    TEST_ASSERT_EQUAL_INT32(-4, scale_apply(&half, -7));
    TEST_ASSERT_EQUAL_INT32(-4, scale_apply(&minus_half, 7));
    TEST_ASSERT_EQUAL_INT32(4, scale_apply(&minus_half, -7));
    TEST_ASSERT_EQUAL_INT32(3, scale_apply(&half, 6));
}

static void test_scale16_keeps_every_bit_before_the_shift(void)
{
    const scale_t third = {21845, 9};
    TEST_ASSERT_EQUAL_INT32((21845 * 9000 + 256) / 512, scale_apply16(&third, 9000));
    TEST_ASSERT_EQUAL_INT32(-((21845 * 9000 + 256) / 512), scale_apply16(&third, -9000));
}

static void test_scale_with_a_shift_beyond_the_value_gives_nothing(void)
{
    const scale_t smallest = {16384, 31};
    TEST_ASSERT_EQUAL_INT32(0, scale_apply(&smallest, INT32_MAX));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_scale_multiplies_by_mantissa_over_two_to_the_15_and_shift);
    RUN_TEST(test_scale_takes_the_largest_values);
    RUN_TEST(test_scale_rounds_to_the_nearest_on_both_sides);
    RUN_TEST(test_scale16_keeps_every_bit_before_the_shift);
    RUN_TEST(test_scale_with_a_shift_beyond_the_value_gives_nothing);
    return UNITY_END();
}
