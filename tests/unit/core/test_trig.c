#include "core/trig.h"
#include "core/fix.h"
#include "wire/crc.h"
#include "unity.h"

#include <math.h>

#define TURN 6.283185307179586

void setUp(void) {}
void tearDown(void) {}

static uint16_t atan2_bam16(int32_t y, int32_t x)
{
    return trig_atan2_bam16(y, x);
}

static void test_sine_and_cosine_are_within_2_units_at_every_angle(void)
{
    double worst = 0.0;
    for (uint32_t angle = 0; angle < 65536; angle++) {
        const double radians = angle * TURN / 65536.0;
        worst = fmax(worst, fabs(trig_sin_q15((uint16_t)angle) - 32767.0 * sin(radians)));
        worst = fmax(worst, fabs(trig_cos_q15((uint16_t)angle) - 32767.0 * cos(radians)));
    }
    TEST_ASSERT_TRUE_MESSAGE(worst <= 2.0, "beyond the bound of trig.h");
}

static void test_sine_is_odd_and_mirrored_at_every_angle(void)
{
    for (uint32_t angle = 0; angle < 65536; angle++) {
        const int16_t sine = trig_sin_q15((uint16_t)angle);
        TEST_ASSERT_EQUAL_INT16(-sine, trig_sin_q15((uint16_t)(0U - angle)));
        TEST_ASSERT_EQUAL_INT16(sine, trig_sin_q15((uint16_t)(32768U - angle)));
        TEST_ASSERT_EQUAL_INT16(trig_cos_q15((uint16_t)angle), trig_cos_q15((uint16_t)(0U - angle)));
    }
}

static double atan2_error_degree(int32_t y, int32_t x)
{
    const double turns = atan2_bam16(y, x) / 65536.0 - atan2(y, x) / TURN;
    return 360.0 * fabs(turns - round(turns));
}

/* xorshift64: operands of every size, of both signs. */
static void test_arc_tangent_is_within_0_02_degree_at_random(void)
{
    uint64_t bits = 88172645463325252ULL;
    double worst = 0.0;
    for (int i = 0; i < 500000; i++) {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        const int32_t y = (int32_t)((int32_t)(bits >> 32) >> (bits & 31));
        const int32_t x = (int32_t)((int32_t)bits >> ((bits >> 5) & 31));
        worst = fmax(worst, atan2_error_degree(y, x));
    }
    TEST_ASSERT_TRUE_MESSAGE(worst <= 0.02, "beyond the bound of trig.h");
}

static void test_sine_and_cosine_are_exact_on_the_axes(void)
{
    static const int16_t SINE[] = {0, 32767, 0, -32767};
    for (uint16_t quarter = 0; quarter < 4; quarter++) {
        TEST_ASSERT_EQUAL_INT16(SINE[quarter], trig_sin_q15((uint16_t)(quarter << 14)));
        TEST_ASSERT_EQUAL_INT16(SINE[(quarter + 1) & 3], trig_cos_q15((uint16_t)(quarter << 14)));
    }
}

static void test_arc_tangent_is_within_0_02_degree_all_round_and_at_every_size(void)
{
    double worst = 0.0;
    for (int bits = 9; bits <= 31; bits++) {
        const double radius = ldexp(1.0, bits) - 1.0;
        for (uint32_t i = 0; i < 20000; i++) {
            const double angle = (i + 0.37) * TURN / 20000.0;
            worst = fmax(worst, atan2_error_degree((int32_t)(radius * sin(angle)), (int32_t)(radius * cos(angle))));
        }
    }
    TEST_ASSERT_TRUE_MESSAGE(worst <= 0.02, "beyond the bound of trig.h");
}

static void test_arc_tangent_is_within_0_02_degree_at_every_small_vector(void)
{
    double worst = 0.0;
    for (int32_t y = -300; y <= 300; y++)
        for (int32_t x = -300; x <= 300; x++)
            worst = fmax(worst, atan2_error_degree(y, x));
    TEST_ASSERT_TRUE_MESSAGE(worst <= 0.02, "beyond the bound of trig.h");
}

static void test_arc_tangent_is_within_0_02_degree_beside_axes_and_diagonals(void)
{
    double worst = 0.0;
    for (int bits = 8; bits <= 31; bits++)
        for (int32_t beside = 1; beside <= 100; beside++) {
            const int32_t size = (int32_t)((1UL << bits) - 1U);
            worst = fmax(worst, atan2_error_degree(size - beside, size));
            worst = fmax(worst, atan2_error_degree(-size, size - beside));
            worst = fmax(worst, atan2_error_degree(beside, -size));
        }
    TEST_ASSERT_TRUE_MESSAGE(worst <= 0.02, "beyond the bound of trig.h");
}

static void test_arc_tangent_is_exact_on_axes_and_diagonals(void)
{
    static const int32_t SIZES[] = {1, 2, 999, 65535, 65536, 123456789, INT32_MAX};
    for (unsigned i = 0; i < sizeof SIZES / sizeof SIZES[0]; i++) {
        const int32_t size = SIZES[i];
        TEST_ASSERT_EQUAL_UINT16(0, atan2_bam16(0, size));
        TEST_ASSERT_EQUAL_UINT16(8192, atan2_bam16(size, size));
        TEST_ASSERT_EQUAL_UINT16(16384, atan2_bam16(size, 0));
        TEST_ASSERT_EQUAL_UINT16(24576, atan2_bam16(size, -size));
        TEST_ASSERT_EQUAL_UINT16(32768, atan2_bam16(0, -size));
        TEST_ASSERT_EQUAL_UINT16(40960, atan2_bam16(-size, -size));
        TEST_ASSERT_EQUAL_UINT16(49152, atan2_bam16(-size, 0));
        TEST_ASSERT_EQUAL_UINT16(57344, atan2_bam16(-size, size));
    }
}

static void test_arc_tangent_takes_any_operand(void)
{
    TEST_ASSERT_EQUAL_UINT16(0, atan2_bam16(0, 0));
    TEST_ASSERT_EQUAL_UINT16(40960, atan2_bam16(INT32_MIN, INT32_MIN));
    TEST_ASSERT_EQUAL_UINT16(49152, atan2_bam16(INT32_MIN, 0));
    TEST_ASSERT_EQUAL_UINT16(16384, atan2_bam16(INT32_MAX, 1));
}

static void test_arc_tangent_is_odd_and_mirrored(void)
{
    for (int32_t y = 1; y < 200000; y += 997)
        for (int32_t x = 1; x < 200000; x += 1009) {
            const uint16_t angle = atan2_bam16(y, x);
            TEST_ASSERT_EQUAL_UINT16(65536U - angle, atan2_bam16(-y, x));
            TEST_ASSERT_EQUAL_UINT16(32768U - angle, atan2_bam16(y, -x));
            TEST_ASSERT_EQUAL_UINT16(16384U - angle, atan2_bam16(x, y));
        }
}

static void test_arc_tangent_undoes_sine_and_cosine(void)
{
    for (uint32_t angle = 0; angle < 65536; angle += 7) {
        const uint16_t back = atan2_bam16(trig_sin_q15((uint16_t)angle), trig_cos_q15((uint16_t)angle));
        TEST_ASSERT_INT16_WITHIN(1, 0, fix_angle_diff_bam16(back, (uint16_t)angle));
    }
}

/* Every brick has the same sine and arc tangent to the bit. A change here changes every golden stream. */
static void test_sine_and_arc_tangent_are_these_to_the_bit(void)
{
    uint16_t sines = CRC_START, tangents = CRC_START;
    for (uint32_t i = 0; i < 65536; i++) {
        sines = crc_of_number(sines, (uint16_t)trig_sin_q15((uint16_t)i));
        tangents =
            crc_of_number(tangents, trig_atan2_bam16((int32_t)(i * 16381U), (int32_t)(i * 65521U - 1000000000U)));
    }
    TEST_ASSERT_EQUAL_HEX16(0x1FB8, sines);
    TEST_ASSERT_EQUAL_HEX16(0x14B5, tangents);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sine_and_cosine_are_within_2_units_at_every_angle);
    RUN_TEST(test_sine_is_odd_and_mirrored_at_every_angle);
    RUN_TEST(test_sine_and_cosine_are_exact_on_the_axes);
    RUN_TEST(test_arc_tangent_is_within_0_02_degree_all_round_and_at_every_size);
    RUN_TEST(test_arc_tangent_is_within_0_02_degree_at_every_small_vector);
    RUN_TEST(test_arc_tangent_is_within_0_02_degree_beside_axes_and_diagonals);
    RUN_TEST(test_arc_tangent_is_within_0_02_degree_at_random);
    RUN_TEST(test_arc_tangent_is_exact_on_axes_and_diagonals);
    RUN_TEST(test_arc_tangent_takes_any_operand);
    RUN_TEST(test_arc_tangent_is_odd_and_mirrored);
    RUN_TEST(test_arc_tangent_undoes_sine_and_cosine);
    RUN_TEST(test_sine_and_arc_tangent_are_these_to_the_bit);
    return UNITY_END();
}
