#include "estimator/pose.h"
#include "unity.h"

static pose_state_t state;
static signals_state_t signals;

void setUp(void)
{
    state = (pose_state_t){.heading_bam16 = 0};
    signals = (signals_state_t){.sensors = {.period_ms = 3}};
}

void tearDown(void) {}

static void run(int32_t travel_um_q5, int16_t turn_bam16, int steps)
{
    signals.travel_um_q5 = travel_um_q5;
    for (int i = 0; i < steps; i++) {
        signals.heading_bam16 = (uint16_t)(signals.heading_bam16 + (uint16_t)turn_bam16);
        pose_step(&state, &signals);
    }
}

static void point(uint16_t heading_bam16)
{
    state.heading_bam16 = signals.heading_bam16 = heading_bam16;
}

static void test_pose_adds_up_travel_below_a_micrometre(void)
{
    run(8, 0, 4000);
    TEST_ASSERT_INT32_WITHIN(130, 1000, signals.x_um);
    TEST_ASSERT_EQUAL_INT32(0, signals.y_um);
}

static void test_pose_goes_right_when_heading_is_a_quarter_turn(void)
{
    point(16384);
    run(32 * 1000, 0, 1000);
    TEST_ASSERT_INT32_WITHIN(100, 1000000, signals.y_um);
    TEST_ASSERT_INT32_WITHIN(100, 0, signals.x_um);
}

static void test_pose_sways_to_the_right_of_the_heading(void)
{
    signals.sway_travel_um_q5 = 32 * 1000;
    run(0, 0, 1000);
    TEST_ASSERT_INT32_WITHIN(100, 1000000, signals.y_um);
    point(16384);
    run(0, 0, 1000);
    TEST_ASSERT_INT32_WITHIN(200, -1000000, signals.x_um);
}

static void test_pose_closes_a_circle(void)
{
    run(32 * 1200, 65, 1008);
    run(32 * 1200, 16, 1);
    TEST_ASSERT_INT32_WITHIN(2000, 0, signals.x_um);
    TEST_ASSERT_INT32_WITHIN(2000, 0, signals.y_um);
}

/* Radius 1 m in steps of 15 degrees: the chord of a step lies along its middle heading. */
static void test_pose_lays_a_step_along_the_middle_heading(void)
{
    run(32 * 261052, 2731, 6);
    TEST_ASSERT_INT32_WITHIN(1000, 1000000, signals.x_um);
    TEST_ASSERT_INT32_WITHIN(1000, 1000000, signals.y_um);
}

static void test_pose_mirrors_left_and_right_forward_and_backward_bit_for_bit(void)
{
    run(32 * 1234 + 7, 33, 3000);
    const signals_state_t right = signals;
    setUp();
    run(32 * 1234 + 7, -33, 3000);
    TEST_ASSERT_EQUAL_INT32(right.x_um, signals.x_um);
    TEST_ASSERT_EQUAL_INT32(-right.y_um, signals.y_um);
    setUp();
    run(-32 * 1234 - 7, 33, 3000);
    TEST_ASSERT_EQUAL_INT32(-right.x_um, signals.x_um);
    TEST_ASSERT_EQUAL_INT32(-right.y_um, signals.y_um);
}

static void test_pose_takes_the_reference_above_all(void)
{
    run(32 * 1234, 33, 10);
    signals.sensors.have = SENSOR_REFERENCE;
    signals.sensors.reference_x_um = -1234567;
    signals.sensors.reference_y_um = 7654321;
    run(32 * 1234, 33, 1);
    TEST_ASSERT_EQUAL_INT32(-1234567, signals.x_um);
    TEST_ASSERT_EQUAL_INT32(7654321, signals.y_um);
}

static void test_pose_saturates(void)
{
    signals.x_um = INT32_MAX - 100;
    run(32 * 1000, 0, 3);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, signals.x_um);
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
    return UNITY_END();
}
