/* The edges of a rotation sensor: when they come, and which signal leads. */
#include <math.h>

#include "avr/quadrature.h"
#include "unity.h"

enum { CYCLES = 4800 };
static const double SECONDS = 3e-4; /* times are within a cycle: the last bits of a double decide which */

void setUp(void) {}
void tearDown(void) {}

/* A wheel from `from` counts at these rates, counts/s, at both ends. */
static quadrature_track_t track(double from, double first, double last)
{
    return (quadrature_track_t){.counts = {from, from + SECONDS * (first + last) / 2},
                                .rate = {first, last},
                                .seconds = SECONDS,
                                .cycles = CYCLES};
}

static void test_at_a_steady_speed_the_edge_comes_where_the_line_crosses(void)
{
    const quadrature_track_t forward = track(6.99, 100, 100), backward = track(7.01, -100, -100);
    int step = 0;

    TEST_ASSERT_UINT_WITHIN(1, 1600, quadrature_next(&forward, 6, &step)); /* 0.01 counts are 0.1 ms */
    TEST_ASSERT_EQUAL(1, step);
    TEST_ASSERT_EQUAL(0, quadrature_next(&forward, 7, &step));
    TEST_ASSERT_UINT_WITHIN(1, 1601, quadrature_next(&backward, 7, &step)); /* below 7, not at 7 */
    TEST_ASSERT_EQUAL(-1, step);
    TEST_ASSERT_EQUAL(0, quadrature_next(&backward, 6, &step));
}

static void test_a_wheel_that_speeds_up_follows_a_parabola(void)
{
    const quadrature_track_t faster = track(0.99, 0, 400); /* 0.01 = 400 / (2 SECONDS) t^2 */
    const double expected = sqrt(0.01 * 2 * SECONDS / 400) / SECONDS * CYCLES;
    int step = 0;

    TEST_ASSERT_UINT_WITHIN(1, (uint32_t)ceil(expected), quadrature_next(&faster, 0, &step));
}

static void test_several_edges_of_one_track_come_one_after_the_other(void)
{
    const quadrature_track_t fast = track(0.5, 10000, 10000);
    int step = 0;

    TEST_ASSERT_UINT_WITHIN(1, 800, quadrature_next(&fast, 0, &step));
    TEST_ASSERT_UINT_WITHIN(1, 2400, quadrature_next(&fast, 1, &step));
    TEST_ASSERT_UINT_WITHIN(1, 4000, quadrature_next(&fast, 2, &step));
    TEST_ASSERT_EQUAL(0, quadrature_next(&fast, 3, &step));
}

static void test_forward_a_leads_b_also_below_zero(void)
{
    for (int64_t count = -8; count < 8; count++) {
        const bool a = quadrature_a(count), b = quadrature_b(count);
        const bool next_a = quadrature_a(count + 1), next_b = quadrature_b(count + 1);
        TEST_ASSERT_TRUE((a != next_a) != (b != next_b)); /* one signal at a time */
        if (!a && next_a)
            TEST_ASSERT_FALSE(b); /* A rises while B is low */
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_at_a_steady_speed_the_edge_comes_where_the_line_crosses);
    RUN_TEST(test_a_wheel_that_speeds_up_follows_a_parabola);
    RUN_TEST(test_several_edges_of_one_track_come_one_after_the_other);
    RUN_TEST(test_forward_a_leads_b_also_below_zero);
    return UNITY_END();
}
