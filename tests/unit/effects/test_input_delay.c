#include "affected.h"

static void test_every_input_is_that_much_later(void)
{
    const double delay = 0.06;
    use("input_delay", &delay);
    const bp_state nominal = tour(plain, 6, 3.3);
    tour(affected, 6, 3.3);
    go(0, 0, delay);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, nominal.x, plant.vehicle.state.x);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, nominal.heading, plant.vehicle.state.heading);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, nominal.wheel_speed[0], plant.vehicle.state.wheel_speed[0]);
}

static void test_a_delay_between_two_steps_lies_between(void)
{
    double x[3];
    for (int i = 0; i < 3; i++) {
        const double delay = 0.06 + 0.0001 * i;
        use("input_delay", &delay);
        start(affected, NULL);
        go(6, 6, 0.3);
        x[i] = plant.vehicle.state.x;
    }
    TEST_ASSERT_TRUE(x[0] > x[1] && x[1] > x[2]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * (x[0] - x[2]), 0.5 * (x[0] + x[2]), x[1]);
}

static void test_floating_arrives_late_too(void)
{
    const double delay = 0.03;
    use("input_delay", &delay);
    start(affected, NULL);
    go(6, 6, 0.3);
    go(NAN, NAN, 0.03);
    TEST_ASSERT_TRUE(plant.vehicle.voltage[0] == 6);
    go(NAN, NAN, 0.003);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
    go(0, 0, 0.03);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
    go(0, 0, 0.003);
    TEST_ASSERT_TRUE(plant.vehicle.voltage[0] == 0);
}

static void test_a_new_command_every_sample_fits_the_longest_delay(void)
{
    const double delay = 0.5;
    use("input_delay", &delay);
    start(affected, NULL);
    for (int i = 0; i < 1000; i++) {
        go(0.001 * i, -0.002 * i, STEP);
        const int late = i < 166 ? 0 : i - 166; /* the delay is 166 2/3 samples, and this one has passed */
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.001 * late, plant.vehicle.voltage[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, -0.002 * late, plant.vehicle.voltage[1]);
    }
}

static void test_more_changes_than_fit_keep_their_order_and_end_at_the_last(void)
{
    const double delay = 0.5;
    use("input_delay", &delay);
    start(affected, NULL);
    double before = 0;
    for (int i = 0; i < 4000; i++) {
        const double given = i < 2000 ? 0.001 * i : 2;
        const double input[2] = {given, -given};
        plant_advance(&plant, input, 0.0005);
        TEST_ASSERT_TRUE(plant.vehicle.voltage[0] >= before && plant.vehicle.voltage[0] <= 2);
        before = plant.vehicle.voltage[0];
    }
    TEST_ASSERT_TRUE(plant.vehicle.voltage[0] == 2 && plant.vehicle.voltage[1] == -2);
}

static void test_no_delay_changes_nothing(void)
{
    const double none = 0;
    use("input_delay", &none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double delay = 0.1;
    use("input_delay", &delay);
    assert_reversal();
    assert_mirror("input_delay", &delay);
    make_motor("input_delay", &delay);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_input_is_that_much_later);
    RUN_TEST(test_a_delay_between_two_steps_lies_between);
    RUN_TEST(test_floating_arrives_late_too);
    RUN_TEST(test_a_new_command_every_sample_fits_the_longest_delay);
    RUN_TEST(test_more_changes_than_fit_keep_their_order_and_end_at_the_last);
    RUN_TEST(test_no_delay_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
