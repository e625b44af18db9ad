#include "affected.h"

static bp_state run(const bp_model *model, double left, double right)
{
    start(model, NULL);
    go(left, right, 0.3);
    return plant.vehicle.state;
}

static void test_the_voltage_is_the_nearest_step(void)
{
    const double step = 0.125;
    use("pwm_quantisation", &step);
    assert_same(run(plain, 4.5, -1.125), run(affected, 4.9, -1.6));
    assert_same(run(plain, 5.625, 0), run(affected, 5.2, 0.5));
    assert_same(run(plain, 9, NAN), run(affected, 8.5, NAN));
}

static void test_no_step_leads_beyond_the_supply(void)
{
    const double step = 0.4;
    use("pwm_quantisation", &step);
    assert_same(run(plain, 9, -9), run(affected, 9, -9));
}

static void test_steps_are_those_of_the_battery_there_is(void)
{
    const double step = 0.5, slope = 0.3;
    const bp_state used = {.charge = 10};
    use("pwm_quantisation", &step);
    use("battery_discharge", &slope);
    start(affected, &used);
    go(4, 4, STEP);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 3, plant.vehicle.voltage[0]);
}

static void test_no_step_changes_nothing(void)
{
    const double none = 0;
    use("pwm_quantisation", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double step = 0.25;
    use("pwm_quantisation", &step);
    assert_reversal();
    assert_mirror("pwm_quantisation", &step);
    make_motor("pwm_quantisation", &step);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_voltage_is_the_nearest_step);
    RUN_TEST(test_no_step_leads_beyond_the_supply);
    RUN_TEST(test_steps_are_those_of_the_battery_there_is);
    RUN_TEST(test_no_step_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
