#include "sensors/battery.h"
#include "unity.h"

static const battery_config_t CONFIG = {.resolution = 0.05};

void setUp(void) {}
void tearDown(void) {}

static void test_battery_reads_down_to_its_resolution(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 8.95, battery_read(&CONFIG, 8.999));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 9.05, battery_read(&CONFIG, 9.051));
    TEST_ASSERT_EQUAL_DOUBLE(0, battery_read(&CONFIG, 0.049));
}

static void test_battery_reads_nothing_below_zero(void)
{
    TEST_ASSERT_EQUAL_DOUBLE(0, battery_read(&CONFIG, -3));
}

static void test_battery_default_reads_the_full_battery_within_one_step(void)
{
    const battery_config_t config = battery_config_default();
    const double read = battery_read(&config, 9);
    TEST_ASSERT_TRUE(read <= 9 && read > 9 - config.resolution);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_battery_reads_down_to_its_resolution);
    RUN_TEST(test_battery_reads_nothing_below_zero);
    RUN_TEST(test_battery_default_reads_the_full_battery_within_one_step);
    return UNITY_END();
}
