#include "affected.h"

static const double RATE = 0.02;

static void test_the_voltage_falls_by_the_rate_whatever_is_drawn(void)
{
    use("battery_fade", &RATE);
    for (int duty = 0; duty <= 9; duty += 9) {
        start(affected, NULL);
        go(duty, duty, 30);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, 9 - RATE * 30, plant.vehicle.supply);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 9 - RATE * 30, plant.vehicle.voltage[0]);
}

static void test_time_before_the_run_counts(void)
{
    use("battery_fade", &RATE);
    const bp_state old = {.age = 100};
    start(affected, &old);
    double out[OUTPUT_COUNT];
    plant_outputs(&plant, out);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 7, out[OUTPUT_BATTERY_VOLTAGE]);
    go(4.5, -4.5, STEP);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 3.5, plant.vehicle.voltage[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -3.5, plant.vehicle.voltage[1]);
}

static void test_an_empty_battery_neither_drives_nor_breaks(void)
{
    use("battery_fade", &RATE);
    const bp_state old = {.age = 1e6};
    start(affected, &old);
    go(9, -9, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.09, plant.vehicle.supply);
}

static void test_no_rate_changes_nothing(void)
{
    const double none = 0;
    use("battery_fade", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double rate = 1;
    use("battery_fade", &rate);
    assert_reversal();
    assert_mirror("battery_fade", &rate);
    make_motor("battery_fade", &rate);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_voltage_falls_by_the_rate_whatever_is_drawn);
    RUN_TEST(test_time_before_the_run_counts);
    RUN_TEST(test_an_empty_battery_neither_drives_nor_breaks);
    RUN_TEST(test_no_rate_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
