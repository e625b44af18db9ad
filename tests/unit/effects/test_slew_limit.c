#include "affected.h"

static const double TIME = 0.1; /* 10 V/s */

static void test_a_step_is_a_ramp_of_the_stated_rate(void)
{
    use("slew_limit", &TIME);
    start(affected, NULL);
    go(6, -3, 0.12);
    const double middle = 0.12 - 0.00015; /* of the last motor step */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, middle / TIME, plant.vehicle.voltage[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -middle / TIME, plant.vehicle.voltage[1]);
    go(6, -3, 1.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 6, plant.vehicle.voltage[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -3, plant.vehicle.voltage[1]);
}

static void test_the_lost_voltage_time_is_the_ramps_triangle(void)
{
    const double odd = 0.0344; /* the ramp ends within a step */
    use("slew_limit", &odd);
    start(affected, NULL);
    double lost = 0;
    for (int i = 0; i < 5000; i++) {
        const double input[2] = {6, 6};
        plant_advance(&plant, input, 0.0003);
        lost += 0.0003 * (6 - plant.vehicle.voltage[0]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * 6 * 6 * odd, lost);
}

static void test_floating_is_at_once_and_the_voltage_climbs_again(void)
{
    use("slew_limit", &TIME);
    start(affected, NULL);
    go(6, 6, 1.5);
    go(NAN, 6, 0.003);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
    go(NAN, 6, 1.5);
    go(6, 6, 0.003);
    TEST_ASSERT_TRUE(plant.vehicle.voltage[0] < 0.05);
}

static void test_no_time_changes_nothing(void)
{
    const double none = 0;
    use("slew_limit", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("slew_limit", &TIME);
    assert_reversal();
    assert_mirror("slew_limit", &TIME);
    make_motor("slew_limit", &TIME);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_step_is_a_ramp_of_the_stated_rate);
    RUN_TEST(test_the_lost_voltage_time_is_the_ramps_triangle);
    RUN_TEST(test_floating_is_at_once_and_the_voltage_climbs_again);
    RUN_TEST(test_no_time_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
