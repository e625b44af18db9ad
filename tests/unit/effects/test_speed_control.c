#include "affected.h"

static const double EMF = 0.245; /* V s/rad, of the preset robot */

/* The gains of a controller of its own kind. */
static const double PI[] = {1, 2, 8}, NONE[] = {1, 0, 0};

static void without_inductance(void)
{
    set("inductance", 0);
}

static void test_the_integral_brings_a_loaded_wheel_to_the_wanted_speed(void)
{
    static const double INTEGRAL_ALONE[] = {0, 0, 8};
    const double *controllers[] = {PI, INTEGRAL_ALONE};
    for (int i = 0; i < 2; i++) {
        use("speed_control", controllers[i]);
        start(affected, NULL);
        go(5, -2, 20);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 5 / EMF, plant.vehicle.state.wheel_speed[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, -2 / EMF, plant.vehicle.state.wheel_speed[1]);
    }
    start(plain, NULL);
    go(5, -2, 20);
    TEST_ASSERT_TRUE(plant.vehicle.state.wheel_speed[0] < 0.99 * 5 / EMF);
}

/* (1 + p) (V - K_e w) / R is (V - K_e w) over a smaller resistance. */
static void test_a_proportional_gain_is_a_smaller_resistance(void)
{
    static const double GAIN[] = {1, 3, 0};
    without_inductance();
    use("speed_control", GAIN);
    TEST_ASSERT_EQUAL_INT(0, bp_model_set(plain, "resistance", 22.0 / (1 + GAIN[1])));
    for (double t = 0.03; t < 0.4; t += 0.05) {
        start(plain, NULL);
        go(6, 3, t);
        const bp_state wanted = plant.vehicle.state;
        start(affected, NULL);
        go(6, 3, t);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, wanted.wheel_speed[0], plant.vehicle.state.wheel_speed[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, wanted.wheel_speed[1], plant.vehicle.state.wheel_speed[1]);
    }
}

static void test_a_held_wheel_gets_all_three_shares(void)
{
    set("wheel_inertia", 1e4);
    use("speed_control", PI);
    start(affected, NULL);
    const double t = 0.6, middle = t - 0.00015; /* of the last motor step */
    go(3, -1, t);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 3 * (PI[0] + PI[1] + PI[2] * middle), plant.vehicle.voltage[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, -1 * (PI[0] + PI[1] + PI[2] * middle), plant.vehicle.voltage[1]);
}

static void test_floating_holds_the_sum(void)
{
    set("wheel_inertia", 1e4);
    use("speed_control", PI);
    start(affected, NULL);
    go(3, 3, 0.3);
    go(NAN, 3, 3.0);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
    go(3, 3, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-2, 3 * (PI[0] + PI[1] + PI[2] * 0.6), plant.vehicle.voltage[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-1, 3 * (PI[0] + PI[1] + PI[2] * 3.6), plant.vehicle.voltage[1]);
}

static void test_feedforward_alone_changes_nothing(void)
{
    use("speed_control", NONE);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("speed_control", PI);
    assert_reversal();
    assert_mirror("speed_control", PI);
    make_motor("speed_control", PI);
    assert_effect();
}

static void test_it_is_off_where_the_drive_closes_a_current_loop(void)
{
    make_motor("speed_control", PI);
    set("torque_per_volt", 0.02);
    assert_no_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_integral_brings_a_loaded_wheel_to_the_wanted_speed);
    RUN_TEST(test_a_proportional_gain_is_a_smaller_resistance);
    RUN_TEST(test_a_held_wheel_gets_all_three_shares);
    RUN_TEST(test_floating_holds_the_sum);
    RUN_TEST(test_feedforward_alone_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    RUN_TEST(test_it_is_off_where_the_drive_closes_a_current_loop);
    return UNITY_END();
}
