#include "affected.h"

/* Motors stalled at a duty d carry i = d V / R, and the battery gives 2 d i. */
static double stalled(double resistance, double part)
{
    use("battery_sag", &resistance);
    set("wheel_inertia", 1e4);
    start(affected, NULL);
    go(9 * part, -9 * part, 2);
    return plant.vehicle.supply;
}

static void test_stalled_voltage_is_that_of_a_divider(void)
{
    const double resistances[] = {0.5, 4, 30, 100};
    for (int i = 0; i < 4; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 9 / (1 + 2 * resistances[i] / 22), stalled(resistances[i], 1));
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 9 / (1 + 0.5 * resistances[i] / 22), stalled(resistances[i], 0.5));
    }
}

static void test_the_voltage_settles_within_a_few_body_steps(void)
{
    const double resistances[] = {1, 4, 100};
    const int steps[] = {4, 4, 20};
    set("wheel_inertia", 1e4);
    for (int i = 0; i < 3; i++) {
        use("battery_sag", &resistances[i]);
        start(affected, NULL);
        go(9, 9, steps[i] * STEP);
        const double settled = 9 / (1 + 2 * resistances[i] / 22);
        TEST_ASSERT_DOUBLE_WITHIN(0.02 * settled, settled, plant.vehicle.supply);
    }
}

/* Battery and motors agree in the step in which the command changes, however long that step is beside L / R. */
static void test_the_first_step_is_exact_without_inductance(void)
{
    const double resistance = 30;
    use("battery_sag", &resistance);
    set("wheel_inertia", 1e4);
    set("inductance", 0);
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, affected, NULL, 0.01, 0.01));
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, (const double[]){9, -4.5}, 0.01));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 9 / (1 + 1.25 * 30 / 22), plant.vehicle.supply);
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, (const double[]){-9, 9}, 0.01));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 9 / (1 + 2 * 30. / 22), plant.vehicle.supply);
}

/* The motors do not draw what a dead band takes of the voltage. */
static void test_the_rest_of_the_drive_is_heeded(void)
{
    const double resistance = 8, deadband[] = {3, 0};
    use("battery_sag", &resistance);
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(affected, "actuator_deadband", deadband));
    set("wheel_inertia", 1e4);
    start(affected, NULL);
    go(9, -9, 0.3);
    const double supply = plant.vehicle.supply;
    const double current = (supply - 3) / 22;
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 9 - 8 * 2 * current * (supply - 3) / supply, supply);
}

static void test_braking_by_reversing_raises_nothing_beyond_bounds(void)
{
    const double resistance = 10;
    use("battery_sag", &resistance);
    start(affected, NULL);
    for (int i = 0; i < 200; i++) {
        go(i % 2 == 0 ? 9 : -9, i % 3 == 0 ? -9 : 9, 0.15);
        TEST_ASSERT_TRUE(plant.vehicle.supply > 1 && plant.vehicle.supply < 14);
    }
}

static void test_no_resistance_changes_nothing(void)
{
    const double none = 0;
    use("battery_sag", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double resistance = 8;
    use("battery_sag", &resistance);
    assert_reversal();
    assert_mirror("battery_sag", &resistance);
    make_motor("battery_sag", &resistance);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_stalled_voltage_is_that_of_a_divider);
    RUN_TEST(test_the_voltage_settles_within_a_few_body_steps);
    RUN_TEST(test_the_first_step_is_exact_without_inductance);
    RUN_TEST(test_the_rest_of_the_drive_is_heeded);
    RUN_TEST(test_braking_by_reversing_raises_nothing_beyond_bounds);
    RUN_TEST(test_no_resistance_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
