#include "affected.h"

static const double SLOPE = 0.2;

/* Two stalled motors at full duty draw q' = 2 V / R. */
static void test_a_stalled_robot_drains_exponentially(void)
{
    use("battery_discharge", &SLOPE);
    set("wheel_inertia", 1e4);
    start(affected, NULL);
    go(9, 9, 15);
    TEST_ASSERT_DOUBLE_WITHIN(0.005, 9 * exp(-2 * SLOPE * 15 / 22), plant.vehicle.supply);
}

static void test_charge_drawn_before_the_run_counts(void)
{
    use("battery_discharge", &SLOPE);
    const bp_state used = {.charge = 10};
    start(affected, &used);
    double out[OUTPUT_COUNT];
    plant_outputs(&plant, out);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 7, out[OUTPUT_BATTERY_VOLTAGE]);
    go(0, 0, STEP);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 7, plant.vehicle.supply);
    go(4.5, 4.5, STEP);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 3.5, plant.vehicle.voltage[0]);
}

static void test_an_empty_battery_neither_drives_nor_breaks(void)
{
    use("battery_discharge", &SLOPE);
    const bp_state used = {.charge = 1000};
    start(affected, &used);
    go(9, -9, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.09, plant.vehicle.supply);
    TEST_ASSERT_TRUE(isfinite(plant.vehicle.state.charge));
}

static void test_no_slope_changes_nothing(void)
{
    const double none = 0;
    use("battery_discharge", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double slope = 5;
    use("battery_discharge", &slope);
    assert_reversal();
    assert_mirror("battery_discharge", &slope);
    make_motor("battery_discharge", &slope);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_stalled_robot_drains_exponentially);
    RUN_TEST(test_charge_drawn_before_the_run_counts);
    RUN_TEST(test_an_empty_battery_neither_drives_nor_breaks);
    RUN_TEST(test_no_slope_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
