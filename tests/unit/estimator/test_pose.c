#include "estimator/pose.h"
#include "unity.h"

static pose_state_t state;
static signals_sensors_t sensors;
static signals_estimate_t estimate;

void setUp(void)
{
    state = (pose_state_t){.heading_bam16 = 0};
    sensors = (signals_sensors_t){.period_ms = 3};
    estimate = (signals_estimate_t){.heading_bam16 = 0};
}

void tearDown(void) {}

static void run(int32_t travel_um_q5, int16_t turn_bam16, int steps)
{
    estimate.travel_um_q5 = travel_um_q5;
    for (int i = 0; i < steps; i++) {
        estimate.heading_bam16 = (uint16_t)(estimate.heading_bam16 + (uint16_t)turn_bam16);
        pose_step(&state, &sensors, &estimate);
    }
}

static void point(uint16_t heading_bam16)
{
    state.heading_bam16 = estimate.heading_bam16 = heading_bam16;
}

static void test_pose_adds_up_travel_below_a_micrometre(void)
{
    run(8, 0, 4000);
    TEST_ASSERT_INT32_WITHIN(130, 1000, estimate.x_um);
    TEST_ASSERT_EQUAL_INT32(0, estimate.y_um);
}

static void test_pose_goes_right_when_heading_is_a_quarter_turn(void)
{
    point(16384);
    run(32 * 1000, 0, 1000);
    TEST_ASSERT_INT32_WITHIN(100, 1000000, estimate.y_um);
    TEST_ASSERT_INT32_WITHIN(100, 0, estimate.x_um);
}

static void test_pose_sways_to_the_right_of_the_heading(void)
{
    estimate.sway_travel_um_q5 = 32 * 1000;
    run(0, 0, 1000);
    TEST_ASSERT_INT32_WITHIN(100, 1000000, estimate.y_um);
    point(16384);
    run(0, 0, 1000);
    TEST_ASSERT_INT32_WITHIN(200, -1000000, estimate.x_um);
}

static void test_pose_closes_a_circle(void)
{
    run(32 * 1200, 65, 1008);
    run(32 * 1200, 16, 1);
    TEST_ASSERT_INT32_WITHIN(2000, 0, estimate.x_um);
    TEST_ASSERT_INT32_WITHIN(2000, 0, estimate.y_um);
}

/* Radius 1 m in steps of 15 degrees: the chord of a step lies along its middle heading. */
static void test_pose_lays_a_step_along_the_middle_heading(void)
{
    run(32 * 261052, 2731, 6);
    TEST_ASSERT_INT32_WITHIN(1000, 1000000, estimate.x_um);
    TEST_ASSERT_INT32_WITHIN(1000, 1000000, estimate.y_um);
}

static void test_pose_mirrors_left_and_right_forward_and_backward_bit_for_bit(void)
{
    run(32 * 1234 + 7, 33, 3000);
    const signals_estimate_t right = estimate;
    setUp();
    run(32 * 1234 + 7, -33, 3000);
    TEST_ASSERT_EQUAL_INT32(right.x_um, estimate.x_um);
    TEST_ASSERT_EQUAL_INT32(-right.y_um, estimate.y_um);
    setUp();
    run(-32 * 1234 - 7, 33, 3000);
    TEST_ASSERT_EQUAL_INT32(-right.x_um, estimate.x_um);
    TEST_ASSERT_EQUAL_INT32(-right.y_um, estimate.y_um);
}

static void test_pose_takes_the_reference_above_all(void)
{
    run(32 * 1234, 33, 10);
    sensors.have = SENSOR_REFERENCE;
    sensors.reference_x_um = -1234567;
    sensors.reference_y_um = 7654321;
    run(32 * 1234, 33, 1);
    TEST_ASSERT_EQUAL_INT32(-1234567, estimate.x_um);
    TEST_ASSERT_EQUAL_INT32(7654321, estimate.y_um);
    TEST_ASSERT_EQUAL_INT16(0, state.x.rest_um_q5);
    TEST_ASSERT_EQUAL_INT16(0, state.y.rest_um_q5);
}

static void test_pose_saturates(void)
{
    state.x.um = INT32_MAX - 100;
    run(32 * 1000, 0, 3);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, estimate.x_um);
}

static void test_pose_rounds_half_a_turn_step_to_the_heading_before(void)
{
    run(32 * 1000000, 1, 1);
    TEST_ASSERT_EQUAL_INT32(0, estimate.y_um);
    setUp();
    run(32 * 1000000, -1, 1);
    TEST_ASSERT_EQUAL_INT32(0, estimate.y_um);
    setUp();
    run(32 * 1000000, 2, 1);
    TEST_ASSERT_NOT_EQUAL_INT32(0, estimate.y_um);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_pose_adds_up_travel_below_a_micrometre);
    RUN_TEST(test_pose_goes_right_when_heading_is_a_quarter_turn);
    RUN_TEST(test_pose_sways_to_the_right_of_the_heading);
    RUN_TEST(test_pose_closes_a_circle);
    RUN_TEST(test_pose_lays_a_step_along_the_middle_heading);
    RUN_TEST(test_pose_mirrors_left_and_right_forward_and_backward_bit_for_bit);
    RUN_TEST(test_pose_takes_the_reference_above_all);
    RUN_TEST(test_pose_saturates);
    RUN_TEST(test_pose_rounds_half_a_turn_step_to_the_heading_before);
    return UNITY_END();
}
