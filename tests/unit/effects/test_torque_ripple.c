#include "affected.h"

static const double QUARTER = 1.5707963267948966;

/* Order 0 is a constant: the motor has 1 + amplitude times its torque. */
static void test_at_order_zero_the_torque_constant_is_larger(void)
{
    const double constant[] = {0.3, 0, QUARTER, 0};
    use("torque_ripple", constant);
    set("drag_area", 0);
    start(affected, NULL);
    go(6, 6, 20);
    const double loss = 1.8e-5 + 0.9 * 9.81 * 0.015 * 0.0408 * 0.0408, k = 1.3 * 0.195 / 22;
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, k * 6 / (loss + k * 0.245), plant.vehicle.state.wheel_speed[0]);
}

static void test_the_torque_is_that_of_the_angle_in_the_middle_of_a_step(void)
{
    const double values[] = {0.5, 100, 0.3, 0.4}, input[2] = {6, 6}, step = 0.0003;
    const bp_state moving = {.wheel_speed = {20, 10}, .wheel_angle = {3, 4}, .current = {0.1, 0.2}};
    use("torque_ripple", values);
    start(affected, &moving);
    plant_advance(&plant, input, step);
    const double left = 100 * (3 + 0.5 * step * 20) + 0.5, right = 100 * (4 + 0.5 * step * 10) + 0.1;
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * 0.195 * 0.1 * sin(left), plant.vehicle.wheel_torque[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * 0.195 * 0.2 * sin(right), plant.vehicle.wheel_torque[1]);
}

/* A small ripple of the speed w: amplitude T / (inertia order w), with T what holds the speed. */
static void test_the_speed_ripples_with_the_order_of_the_angle(void)
{
    const double values[] = {0.5, 5, 0, 0};
    use("torque_ripple", values);
    start(affected, NULL);
    go(6, 6, 10);
    const double mean = plant.vehicle.state.wheel_speed[0], from = plant.vehicle.state.wheel_angle[0];
    double low = 1e9, high = 0, sum = 0;
    int rises = 0;
    bool above = true;
    for (int i = 0; i < 1000; i++) {
        go(6, 6, STEP);
        const double speed = plant.vehicle.state.wheel_speed[0];
        low = fmin(low, speed);
        high = fmax(high, speed);
        rises += !above && speed > mean;
        above = speed > mean;
        sum += 0.195 * plant.vehicle.state.current[0] / 1000;
    }
    const double turned = plant.vehicle.state.wheel_angle[0] - from;
    TEST_ASSERT_INT_WITHIN(1, (int)(5 * turned / (4 * QUARTER)), rises);
    const double inertia = 1e-4 + 0.45 * 0.0408 * 0.0408;
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * (high - low), 2 * 0.5 * sum / (inertia * 5 * mean), high - low);
}

static void test_a_floating_motor_has_no_ripple(void)
{
    const double values[] = {0.5, 5, 1, 0};
    const bp_state moving = {.surge = 0.5};
    use("torque_ripple", values);
    start(plain, &moving);
    go(NAN, NAN, 0.6);
    const bp_state nominal = plant.vehicle.state;
    start(affected, &moving);
    go(NAN, NAN, 0.6);
    assert_same(nominal, plant.vehicle.state);
}

static void test_no_amplitude_changes_nothing(void)
{
    const double none[] = {0, 6, 1, 1};
    use("torque_ripple", none);
    assert_no_effect();
}

static void test_a_drive_that_commands_force_ripples_too(void)
{
    const double constant[] = {0.3, 0, QUARTER, 0};
    make(BP_MOTOR, BP_COUPLED);
    set("force_per_volt", 35);
    set("mass", 95);
    set("viscous_friction", 200);
    use("torque_ripple", constant);
    start(affected, NULL);
    go(2, 0, 20);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.3 * 2 * 35 / 200, plant.vehicle.state.wheel_speed[0]);
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double values[] = {0.8, 3, QUARTER, 0.7}, mirrored[] = {0.8, 3, QUARTER, -0.7};
    use("torque_ripple", values);
    assert_mirror("torque_ripple", mirrored);
    const double even[] = {0.8, 3, QUARTER, 0};
    use("torque_ripple", even);
    assert_reversal();
    make_motor("torque_ripple", even);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_at_order_zero_the_torque_constant_is_larger);
    RUN_TEST(test_the_torque_is_that_of_the_angle_in_the_middle_of_a_step);
    RUN_TEST(test_the_speed_ripples_with_the_order_of_the_angle);
    RUN_TEST(test_a_floating_motor_has_no_ripple);
    RUN_TEST(test_no_amplitude_changes_nothing);
    RUN_TEST(test_a_drive_that_commands_force_ripples_too);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
