#include <math.h>

#include "sensors/random.h"
#include "unity.h"

enum { COUNT = 200000 };

static random_t random_state;

void setUp(void)
{
    random_start(&random_state, 42);
}
void tearDown(void) {}

/* The first numbers for the seed 42, computed once in Python from the published algorithms. */
static void test_random_is_the_published_generator(void)
{
    TEST_ASSERT_EQUAL_DOUBLE(0.08386297105988216, random_uniform(&random_state));
    TEST_ASSERT_EQUAL_DOUBLE(0.3789802506626686, random_uniform(&random_state));
}

static void test_random_normal_has_mean_0_sd_1_and_normal_tails(void)
{
    double sum = 0, squares = 0, fourth = 0;
    int beyond = 0;
    for (int i = 0; i < COUNT; i++) {
        const double x = random_normal(&random_state);
        sum += x;
        squares += x * x;
        fourth += x * x * x * x;
        beyond += fabs(x) > 3;
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, sum / COUNT);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 1, squares / COUNT);
    TEST_ASSERT_DOUBLE_WITHIN(0.06, 3, fourth / COUNT);
    TEST_ASSERT_INT_WITHIN(90, 540, beyond); /* 0.27 % */
}

static void test_random_neighbouring_seeds_are_unrelated(void)
{
    random_t other;
    random_start(&other, 43);
    double product = 0;
    for (int i = 0; i < COUNT; i++)
        product += random_normal(&random_state) * random_normal(&other);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, product / COUNT);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_random_is_the_published_generator);
    RUN_TEST(test_random_normal_has_mean_0_sd_1_and_normal_tails);
    RUN_TEST(test_random_neighbouring_seeds_are_unrelated);
    return UNITY_END();
}
