/* The arithmetic against 64-bit integers and doubles: at every pair of edges, and at seeded random operands. */
#include "core/fix.h"
#include "unity.h"

#include <math.h>

static const int32_t EDGES[] = {
    INT32_MIN, INT32_MIN + 1, -2147418112, -1073741824,   -65537,    -65536, -65535, -32769,
    -32768,    -32767,        -256,        -255,          -2,        -1,     0,      1,
    2,         255,           256,         32767,         32768,     65535,  65536,  65537,
    16777215,  1073741823,    1073741824,  INT32_MAX - 1, INT32_MAX,
};
enum { EDGE_COUNT = sizeof EDGES / sizeof EDGES[0], RANDOM_COUNT = 200000 };

static uint64_t random_state;

void setUp(void)
{
    random_state = 0x9E3779B97F4A7C15ULL;
}
void tearDown(void) {}

/* xorshift64; every size of number is as likely as any other. */
static int32_t random_i32(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (int32_t)((int32_t)(random_state >> 32) >> (random_state & 31));
}

static int64_t saturated(int64_t value, int64_t limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

static void check_pair(int32_t a, int32_t b)
{
    const int16_t a16 = (int16_t)a;
    const int16_t b16 = (int16_t)b;
    TEST_ASSERT_EQUAL_INT64(saturated((int64_t)a + b, INT32_MAX), fix_add32(a, b));
    TEST_ASSERT_EQUAL_INT64(saturated((int64_t)a - b, INT32_MAX), fix_sub32(a, b));
    TEST_ASSERT_EQUAL_INT64(saturated((int64_t)a16 + b16, INT16_MAX), fix_add16(a16, b16));
    TEST_ASSERT_EQUAL_INT64(saturated((int64_t)a16 - b16, INT16_MAX), fix_sub16(a16, b16));
    TEST_ASSERT_EQUAL_INT64((int64_t)a16 * b16, fix_mul(a16, b16));
    TEST_ASSERT_EQUAL_INT64((int64_t)a16 + b16, fix_add(a16, b16));
    TEST_ASSERT_EQUAL_UINT64((uint64_t)(uint16_t)a * (uint16_t)b, fix_mul_u16((uint16_t)a, (uint16_t)b));
    TEST_ASSERT_EQUAL_UINT64((uint64_t)(uint32_t)a * (uint16_t)b >> 16, fix_mul_u32_q16((uint32_t)a, (uint16_t)b));
    TEST_ASSERT_EQUAL_INT64((int64_t)a * (uint16_t)b / 65536, fix_mul_q16(a, (uint16_t)b));
    TEST_ASSERT_EQUAL_INT64(saturated((int64_t)a16 * b16 / 32768, INT16_MAX), fix_mul16_q15(a16, b16));
    if ((uint16_t)b != 0)
        TEST_ASSERT_EQUAL_UINT32((uint32_t)a / (uint16_t)b, fix_div_u32((uint32_t)a, (uint16_t)b));
}

static void test_fix_sums_products_and_quotients_hold_at_the_edges(void)
{
    for (int i = 0; i < EDGE_COUNT; i++)
        for (int j = 0; j < EDGE_COUNT; j++)
            check_pair(EDGES[i], EDGES[j]);
}

static void test_fix_sums_products_and_quotients_hold_at_random(void)
{
    for (int i = 0; i < RANDOM_COUNT; i++) {
        const int32_t a = random_i32();
        check_pair(a, random_i32());
    }
}

static void test_fix_division_by_zero_gives_the_largest_number(void)
{
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, fix_div_u32(0, 0));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, fix_div_u32(123456, 0));
}

static void test_fix_square_root_is_rounded_down(void)
{
    for (uint32_t root = 0; root <= 65535; root++) {
        TEST_ASSERT_EQUAL_UINT16(root, fix_sqrt_u32(root * root));
        TEST_ASSERT_EQUAL_UINT16(root, fix_sqrt_u32(root * root + 2 * root));
    }
}

static void test_fix_round_shift_rounds_to_nearest_and_is_odd(void)
{
    for (int i = 0; i < RANDOM_COUNT; i++) {
        const int32_t value = i < EDGE_COUNT ? EDGES[i] : random_i32();
        TEST_ASSERT_EQUAL_INT32((int32_t)round(value / 2.0), fix_round_shift(value, 1));
        TEST_ASSERT_EQUAL_INT32((int32_t)round(value / 65536.0), fix_round_shift(value, 16));
        TEST_ASSERT_EQUAL_INT32((int32_t)round(value / 1073741824.0), fix_round_shift(value, 30));
    }
}

static void test_fix_gain_and_division_by_1000_are_rounded_to_nearest_and_saturate(void)
{
    for (int i = 0; i < RANDOM_COUNT; i++) {
        const int32_t value = i < EDGE_COUNT ? EDGES[i] : random_i32();
        const int16_t gain = (int16_t)(random_i32() & 32767), value16 = (int16_t)value;
        const int64_t product = (int64_t)round(gain * value16 / 1024.0);
        TEST_ASSERT_EQUAL_INT64(product, fix_mul_q10(gain, value16));
        TEST_ASSERT_EQUAL_INT64(saturated(product, INT16_MAX), fix_mul16_q10(gain, value16));
        TEST_ASSERT_EQUAL_INT64(saturated((int64_t)round(value * (16777.0 / 16777216.0)), INT16_MAX),
                                fix_div_1000(value));
    }
}

static void test_fix_vectors_are_multiplied_and_projected_on_a_direction(void)
{
    for (int i = 0; i < RANDOM_COUNT; i++) {
        const fix_vector_t of = {fix_sat16(random_i32()), fix_sat16(random_i32())};
        const fix_vector_t with = {fix_sat16(random_i32()), fix_sat16(random_i32())};
        const int64_t product = (int64_t)of.x * with.x + (int64_t)of.y * with.y;
        TEST_ASSERT_EQUAL_INT64(product, fix_dot(&of, &with));
        TEST_ASSERT_EQUAL_INT64(saturated((int64_t)round((double)product / 32768.0), INT16_MAX),
                                fix_project(&of, &with));
    }
}

static void test_fix_tells_how_a_value_compares_with_a_square(void)
{
    for (int32_t root = 0; root <= 32768; root++)
        for (int32_t more = -1; more <= 1; more++) {
            const int32_t value = root * root + more;
            if (value < 0)
                continue;
            const int16_t found = fix_compare_square(value, (uint16_t)root);
            TEST_ASSERT_EQUAL_INT32(more, (found > 0) - (found < 0));
        }
}

static void test_fix_right_shift_of_negative_numbers_is_arithmetic(void)
{
    volatile int32_t minus_three = -3;
    volatile int16_t minus_one = -1;
    TEST_ASSERT_EQUAL_INT32(-2, minus_three >> 1);
    TEST_ASSERT_EQUAL_INT32(-1, minus_one >> 15);
}

static void test_fix_limits_are_met_and_not_passed(void)
{
    TEST_ASSERT_EQUAL_INT16(32767, fix_sat16(32768));
    TEST_ASSERT_EQUAL_INT16(-32767, fix_sat16(-32768));
    TEST_ASSERT_EQUAL_INT16(-1234, fix_sat16(-1234));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, fix_clamp32(INT32_MAX, INT32_MAX));
    TEST_ASSERT_EQUAL_INT32(-INT32_MAX, fix_clamp32(INT32_MIN, INT32_MAX));
    TEST_ASSERT_EQUAL_INT32(5, fix_clamp32(6, 5));
    TEST_ASSERT_EQUAL_INT16(-5, fix_clamp16(INT16_MIN, 5));
    TEST_ASSERT_EQUAL_INT16(4, fix_clamp16(4, 5));
    TEST_ASSERT_EQUAL_UINT16(32768, fix_abs_u16(INT16_MIN));
    TEST_ASSERT_EQUAL_UINT32(2147483648U, fix_abs_u32(INT32_MIN));
}

static void test_fix_counts_stay_at_their_end(void)
{
    TEST_ASSERT_EQUAL_UINT16(65535, fix_increment_u16(65534));
    TEST_ASSERT_EQUAL_UINT16(65535, fix_increment_u16(65535));
}

static void test_fix_compare16_tells_the_side(void)
{
    TEST_ASSERT_EQUAL_INT8(0, fix_compare16(-7, -7));
    TEST_ASSERT_EQUAL_INT8(1, fix_compare16(INT16_MAX, INT16_MIN));
    TEST_ASSERT_EQUAL_INT8(-1, fix_compare16(INT16_MIN, INT16_MAX));
    TEST_ASSERT_EQUAL_INT8(-1, fix_compare16(-8, -7));
    TEST_ASSERT_EQUAL_INT8(1, fix_compare16(-7, -8));
}

static void test_fix_angle_difference_takes_the_short_way_round(void)
{
    TEST_ASSERT_EQUAL_INT16(2, fix_angle_diff_bam16(1, 65535));
    TEST_ASSERT_EQUAL_INT16(-2, fix_angle_diff_bam16(65535, 1));
    TEST_ASSERT_EQUAL_INT16(-32768, fix_angle_diff_bam16(32768, 0));
}

static void test_fix_product_and_truncated_shift_round_towards_zero_on_both_sides(void)
{
    TEST_ASSERT_EQUAL_INT32(2, fix_mul_q15(5, 16384));
    TEST_ASSERT_EQUAL_INT32(-2, fix_mul_q15(-5, 16384));
    TEST_ASSERT_EQUAL_INT32(-2, fix_mul_q15(5, -16384));
    TEST_ASSERT_EQUAL_INT32(2, fix_mul_q15(-5, -16384));
    TEST_ASSERT_EQUAL_INT32(-100, fix_mul_q15(100, -32768));
    TEST_ASSERT_EQUAL_INT32(100, fix_mul_q15(-100, -32768));
    TEST_ASSERT_EQUAL_INT32(-1073741824L, fix_mul_q15(INT32_MIN, 16384));
    TEST_ASSERT_EQUAL_INT32(FIX_INT32_MAX, fix_mul_q15(INT32_MIN, -32768));
    TEST_ASSERT_EQUAL_INT32(3, fix_trunc_shift(31, 3));
    TEST_ASSERT_EQUAL_INT32(-3, fix_trunc_shift(-31, 3));
    TEST_ASSERT_EQUAL_INT32(-31, fix_trunc_shift(-31, 0));
}

static void test_fix_round_bam16_rounds_halves_away_from_zero(void)
{
    TEST_ASSERT_EQUAL_UINT16(1, fix_round_bam16(32768U));
    TEST_ASSERT_EQUAL_UINT16(0, fix_round_bam16(32767U));
    TEST_ASSERT_EQUAL_UINT16(65535, fix_round_bam16(0U - 32768U));
    TEST_ASSERT_EQUAL_UINT16(0, fix_round_bam16(0U - 32767U));
}

static void test_fix_reciprocal_is_to_the_nearest(void)
{
    TEST_ASSERT_EQUAL_INT16(32767, fix_reciprocal_q15(1));
    for (int value = 2; value < 256; value++)
        TEST_ASSERT_EQUAL_INT16((2 * 32768 / value + 1) / 2, fix_reciprocal_q15((uint8_t)value));
}

static void test_fix_counts_the_bits_of_a_number(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, fix_bit_length(0, 12));
    TEST_ASSERT_EQUAL_UINT8(1, fix_bit_length(1, 12));
    TEST_ASSERT_EQUAL_UINT8(3, fix_bit_length(4, 12));
    TEST_ASSERT_EQUAL_UINT8(16, fix_bit_length(65535, 16));
    TEST_ASSERT_EQUAL_UINT8(4, fix_bit_length(65535, 4));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_fix_sums_products_and_quotients_hold_at_the_edges);
    RUN_TEST(test_fix_sums_products_and_quotients_hold_at_random);
    RUN_TEST(test_fix_division_by_zero_gives_the_largest_number);
    RUN_TEST(test_fix_square_root_is_rounded_down);
    RUN_TEST(test_fix_round_shift_rounds_to_nearest_and_is_odd);
    RUN_TEST(test_fix_gain_and_division_by_1000_are_rounded_to_nearest_and_saturate);
    RUN_TEST(test_fix_vectors_are_multiplied_and_projected_on_a_direction);
    RUN_TEST(test_fix_tells_how_a_value_compares_with_a_square);
    RUN_TEST(test_fix_right_shift_of_negative_numbers_is_arithmetic);
    RUN_TEST(test_fix_limits_are_met_and_not_passed);
    RUN_TEST(test_fix_counts_stay_at_their_end);
    RUN_TEST(test_fix_compare16_tells_the_side);
    RUN_TEST(test_fix_angle_difference_takes_the_short_way_round);
    RUN_TEST(test_fix_product_and_truncated_shift_round_towards_zero_on_both_sides);
    RUN_TEST(test_fix_round_bam16_rounds_halves_away_from_zero);
    RUN_TEST(test_fix_reciprocal_is_to_the_nearest);
    RUN_TEST(test_fix_counts_the_bits_of_a_number);
    return UNITY_END();
}
