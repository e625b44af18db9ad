#include "composed.h"

static void test_what_a_gyro_adds_its_angle_sums_up(void)
{
    const bp_state turning = {.yaw_rate = 2};
    term("gyro_add_r3", 0.01);
    start(&turning);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2.08, out[OUTPUT_YAW_RATE]);
    go(NAN, NAN, 0.9);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2.08, out[OUTPUT_YAW_RATE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.9 * 2.08, out[OUTPUT_YAW_ANGLE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.9 * 2, state()->heading);
}

static void test_sensors_do_not_move_the_vehicle(void)
{
    const bp_state plain = tour();
    term("gyro_add_u", 0.5);
    term("accel_surge_add_a", 0.1);
    term("accel_sway_add_b", 0.1);
    term("encoder_gain_one", 0.1);
    term("encoder_gain_diff_cos_angle", 0.2);
    const bp_state seen = tour();
    TEST_ASSERT_EQUAL_MEMORY(&plain, &seen, sizeof plain);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.1 * plant.vehicle.accel_surge, out[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.1 * plant.vehicle.accel_sway, out[OUTPUT_ACCEL_SWAY]);
}

static void test_each_accelerometer_reads_a_share_of_the_other_s_axis(void)
{
    term("accel_surge_add_b", 0.1);
    term("accel_sway_add_a", 0.2);
    start(NULL);
    go(6, 3, 0.3);
    const double ahead = plant.vehicle.accel_surge, right = plant.vehicle.accel_sway;
    TEST_ASSERT_TRUE(fabs(ahead) > 0.1 && fabs(right) > 0.1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, ahead + 0.1 * right, out[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, right + 0.2 * ahead, out[OUTPUT_ACCEL_SWAY]);
}

static void test_opposite_shares_are_accelerometers_turned_by_a_small_angle(void)
{
    const double angle = 1e-3;
    double turned[OUTPUT_COUNT];
    on("accel_misalignment", angle, 0, 0);
    tour();
    memcpy(turned, out, sizeof out);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term("accel_surge_add_b", angle);
    term("accel_sway_add_a", -angle);
    tour();
    const double larger = fmax(fabs(out[OUTPUT_ACCEL_SURGE]), fabs(out[OUTPUT_ACCEL_SWAY]));
    const double second_order = angle * angle * larger;
    TEST_ASSERT_TRUE(fabs(out[OUTPUT_ACCEL_SURGE] - plant.vehicle.accel_surge) > 50 * second_order);
    TEST_ASSERT_DOUBLE_WITHIN(second_order, turned[OUTPUT_ACCEL_SURGE], out[OUTPUT_ACCEL_SURGE]);
    TEST_ASSERT_DOUBLE_WITHIN(second_order, turned[OUTPUT_ACCEL_SWAY], out[OUTPUT_ACCEL_SWAY]);
}

/* The sum over body steps of 3 ms is the angle to the second order. */
static void test_a_constant_gain_is_a_scale_of_the_rotation_sensors(void)
{
    double scaled[OUTPUT_COUNT];
    on("encoder_scale", 0.1, 0, 0);
    start(NULL);
    go(6, -3, 0.6);
    memcpy(scaled, out, sizeof out);
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
    term("encoder_gain_one", 0.1);
    start(NULL);
    go(6, -3, 0.6);
    for (int k = 0; k < 2; k++) {
        const double angle = state()->wheel_angle[k];
        TEST_ASSERT_TRUE(fabs(angle) > 1);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, scaled[OUTPUT_WHEEL_SPEED_LEFT + k], out[OUTPUT_WHEEL_SPEED_LEFT + k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, scaled[OUTPUT_WHEEL_VELOCITY_LEFT + k], out[OUTPUT_WHEEL_VELOCITY_LEFT + k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.1, out[OUTPUT_WHEEL_ANGLE_LEFT + k] / angle - 1);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, RADIUS * out[OUTPUT_WHEEL_ANGLE_LEFT + k], out[OUTPUT_WHEEL_TRAVEL_LEFT + k]);
    }
}

/* What is read of a wheel whose disc sits off its axle, at constant speed: theta + c sin(n theta) / n, from 0 on. */
static void test_an_eccentric_disc_reads_too_far_and_too_little_in_each_turn(void)
{
    const bp_state rolled = {.surge = 0.4, .wheel_angle = {2, -1}};
    term("order", 2);
    term("encoder_gain_cos_angle", 0.05);
    start(&rolled);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2, out[OUTPUT_WHEEL_ANGLE_LEFT]);
    go(NAN, NAN, 0.9);
    for (int k = 0; k < 2; k++) {
        const double speed = state()->wheel_speed[k], angle = state()->wheel_angle[k];
        const double more = 0.05 * (sin(2 * angle) - sin(2 * rolled.wheel_angle[k])) / 2;
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.4 / RADIUS, speed);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, speed * (1 + 0.05 * cos(2 * angle)), out[OUTPUT_WHEEL_SPEED_LEFT + k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, angle + more, out[OUTPUT_WHEEL_ANGLE_LEFT + k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4 * RADIUS, RADIUS * (angle + more), out[OUTPUT_WHEEL_TRAVEL_LEFT + k]);
    }
}

static void test_a_difference_reads_more_at_the_left_and_less_at_the_right(void)
{
    const bp_state rolling = {.surge = 0.4};
    const double speed = 0.4 / RADIUS;
    term("encoder_gain_diff_one", 0.1);
    term("encoder_gain_abs_w", 0.01);
    start(&rolling);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, speed * (1.1 + 0.01 * speed), out[OUTPUT_WHEEL_SPEED_LEFT]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, speed * (0.9 + 0.01 * speed), out[OUTPUT_WHEEL_SPEED_RIGHT]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, RADIUS * out[OUTPUT_WHEEL_SPEED_RIGHT], out[OUTPUT_WHEEL_VELOCITY_RIGHT]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_what_a_gyro_adds_its_angle_sums_up);
    RUN_TEST(test_sensors_do_not_move_the_vehicle);
    RUN_TEST(test_each_accelerometer_reads_a_share_of_the_other_s_axis);
    RUN_TEST(test_opposite_shares_are_accelerometers_turned_by_a_small_angle);
    RUN_TEST(test_a_constant_gain_is_a_scale_of_the_rotation_sensors);
    RUN_TEST(test_an_eccentric_disc_reads_too_far_and_too_little_in_each_turn);
    RUN_TEST(test_a_difference_reads_more_at_the_left_and_less_at_the_right);
    return UNITY_END();
}
