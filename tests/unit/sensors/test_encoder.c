#include "sensors/encoder.h"
#include "unity.h"

static const double TURN = 6.283185307179586;
static encoder_config_t config;

void setUp(void)
{
    config = encoder_config_default();
}
void tearDown(void) {}

static void test_encoder_counts_48_a_turn(void)
{
    TEST_ASSERT_EQUAL_INT64(48, encoder_read(&config, TURN * 1.001));
    TEST_ASSERT_EQUAL_INT64(480000, encoder_read(&config, TURN * 10000.001));
}

static void test_encoder_changes_count_at_even_angles_through_zero(void)
{
    TEST_ASSERT_EQUAL_INT64(0, encoder_read(&config, 0));
    TEST_ASSERT_EQUAL_INT64(0, encoder_read(&config, 0.99 * TURN / 48));
    TEST_ASSERT_EQUAL_INT64(1, encoder_read(&config, 1.01 * TURN / 48));
    TEST_ASSERT_EQUAL_INT64(-1, encoder_read(&config, -0.01 * TURN / 48));
    TEST_ASSERT_EQUAL_INT64(-2, encoder_read(&config, -1.01 * TURN / 48));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_encoder_counts_48_a_turn);
    RUN_TEST(test_encoder_changes_count_at_even_angles_through_zero);
    return UNITY_END();
}
