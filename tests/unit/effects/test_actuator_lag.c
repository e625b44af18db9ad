#include "affected.h"

static const double LAG = 0.08;

static void test_a_step_is_followed_exponentially(void)
{
    use("actuator_lag", &LAG);
    start(affected, NULL);
    go(6, -3, 0.12);
    const double middle = 0.12 - 0.00015; /* of the last motor step */
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 6 * (1 - exp(-middle / LAG)), plant.vehicle.voltage[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, -3 * (1 - exp(-middle / LAG)), plant.vehicle.voltage[1]);
}

static void test_the_lost_voltage_time_is_the_time_constant(void)
{
    use("actuator_lag", &LAG);
    start(affected, NULL);
    double lost = 0;
    for (int i = 0; i < 5000; i++) {
        const double input[2] = {6, 6};
        plant_advance(&plant, input, 0.0003);
        lost += 0.0003 * (6 - plant.vehicle.voltage[0]);
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 6 * LAG, lost);
}

static void test_floating_is_at_once_and_the_voltage_returns_with_the_lag(void)
{
    use("actuator_lag", &LAG);
    start(affected, NULL);
    go(6, 6, 1.5);
    go(NAN, 6, 0.003);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
    go(NAN, 6, 1.5);
    go(6, 6, 0.003);
    TEST_ASSERT_TRUE(plant.vehicle.voltage[0] < 0.25);
}

static void test_a_short_lag_is_none(void)
{
    const double brief = 1e-6;
    use("actuator_lag", &brief);
    const bp_state nominal = tour(plain, 6, 3.3), other = tour(affected, 6, 3.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, nominal.wheel_angle[0], other.wheel_angle[0]);
}

static void test_no_lag_changes_nothing(void)
{
    const double none = 0;
    use("actuator_lag", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("actuator_lag", &LAG);
    assert_reversal();
    assert_mirror("actuator_lag", &LAG);
    make_motor("actuator_lag", &LAG);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_step_is_followed_exponentially);
    RUN_TEST(test_the_lost_voltage_time_is_the_time_constant);
    RUN_TEST(test_floating_is_at_once_and_the_voltage_returns_with_the_lag);
    RUN_TEST(test_a_short_lag_is_none);
    RUN_TEST(test_no_lag_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
