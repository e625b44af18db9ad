#include "composed.h"

void setUp(void)
{
    presets();
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

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

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_what_a_gyro_adds_its_angle_sums_up);
    RUN_TEST(test_sensors_do_not_move_the_vehicle);
    RUN_TEST(test_each_accelerometer_reads_a_share_of_the_other_s_axis);
    RUN_TEST(test_opposite_shares_are_accelerometers_turned_by_a_small_angle);
    return UNITY_END();
}
