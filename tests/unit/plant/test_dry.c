#include <math.h>

#include "plant/dry.h"
#include "sensors/random.h"
#include "unity.h"

static const pair_t MATRIX = {.left = 8e-4, .right = 7e-4, .cross = 3e-4};
static pair_t inverse;

void setUp(void)
{
    const double scale = 1 / (MATRIX.left * MATRIX.right - MATRIX.cross * MATRIX.cross);
    inverse = (pair_t){MATRIX.right * scale, MATRIX.left * scale, -MATRIX.cross * scale};
}
void tearDown(void) {}

static double cost(double left, double right, const double free[2], const double bound[DRY_COUNT])
{
    const double l = left - free[0], r = right - free[1];
    return 0.5 * (MATRIX.left * l * l + MATRIX.right * r * r) + MATRIX.cross * l * r + bound[DRY_LEFT] * fabs(left) +
           bound[DRY_RIGHT] * fabs(right) + bound[DRY_SURGE] * fabs(left + right) + bound[DRY_YAW] * fabs(left - right);
}

static void assert_no_neighbour_costs_less(const double free[2], const double w[2], const double bound[DRY_COUNT])
{
    const double here = cost(w[0], w[1], free, bound);
    for (int i = 0; i < 64; i++)
        for (double radius = 1e-6; radius < 2; radius *= 10) {
            const double angle = i * 6.283185307179586 / 64;
            const double there = cost(w[0] + radius * cos(angle), w[1] + radius * sin(angle), free, bound);
            TEST_ASSERT_TRUE(here <= there + 1e-15);
        }
}

static void test_dry_solution_is_the_minimum_for_random_speeds_and_bounds(void)
{
    random_t random;
    random_start(&random, 1);
    int held[4] = {0};
    for (int n = 0; n < 2000; n++) {
        double bound[DRY_COUNT];
        for (int i = 0; i < DRY_COUNT; i++)
            bound[i] = random_uniform(&random) < 0.5 ? 0 : 1e-3 * random_uniform(&random);
        const double free[2] = {random_normal(&random), random_normal(&random)};
        double w[2] = {free[0], free[1]};
        dry_solve(w, &MATRIX, &inverse, bound);
        assert_no_neighbour_costs_less(free, w, bound);
        held[(w[0] == 0) + 2 * (w[1] == 0)]++;
    }
    for (int i = 0; i < 4; i++)
        TEST_ASSERT_GREATER_THAN(20, held[i]); /* slipping, each wheel held, both held: each case has occurred */
}

static void test_dry_holds_motions_at_exactly_zero(void)
{
    const double yaw_only[DRY_COUNT] = {0, 0, 0, 1};
    double w[2] = {1.0, 0.9};
    dry_solve(w, &MATRIX, &inverse, yaw_only);
    TEST_ASSERT_TRUE(w[0] == w[1]);
    TEST_ASSERT_TRUE(w[0] > 0.9);

    const double surge_only[DRY_COUNT] = {0, 0, 1, 0};
    double spin[2] = {1.0, -0.9};
    dry_solve(spin, &MATRIX, &inverse, surge_only);
    TEST_ASSERT_TRUE(spin[0] == -spin[1]);
    TEST_ASSERT_TRUE(spin[0] > 0.9);
}

static void test_dry_is_the_same_left_and_right_forward_and_backward(void)
{
    const pair_t even = {8e-4, 8e-4, 3e-4};
    const double scale = 1 / (even.left * even.right - even.cross * even.cross);
    const pair_t back = {even.right * scale, even.left * scale, -even.cross * scale};
    random_t random;
    random_start(&random, 2);
    for (int n = 0; n < 1000; n++) {
        const double size = 2e-4 * random_uniform(&random);
        const double bound[DRY_COUNT] = {size, size, 0.5 * size, 0.2 * size};
        const double l = random_normal(&random), r = random_normal(&random);
        double w[2] = {l, r}, swapped[2] = {r, l}, reversed[2] = {-l, -r};
        dry_solve(w, &even, &back, bound);
        dry_solve(swapped, &even, &back, bound);
        dry_solve(reversed, &even, &back, bound);
        TEST_ASSERT_TRUE(swapped[0] == w[1] && swapped[1] == w[0]);
        TEST_ASSERT_TRUE(reversed[0] == -w[0] && reversed[1] == -w[1]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_dry_solution_is_the_minimum_for_random_speeds_and_bounds);
    RUN_TEST(test_dry_holds_motions_at_exactly_zero);
    RUN_TEST(test_dry_is_the_same_left_and_right_forward_and_backward);
    return UNITY_END();
}
