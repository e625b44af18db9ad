#include "app/params_gen.h"
#include "estimator/friction.h"
#include "unity.h"

static const friction_config_t *const CONFIG = &PARAMS_COUPLED.step.speed.friction;
enum { Q17 = 131072, CRUISE_Q4 = 8000, TOLD_MS = FRICTION_SLOW_MS + 3 };
static friction_state_t state;
static friction_input_t input;

void setUp(void)
{
    state = (friction_state_t){.learnt_mv_q4 = 0};
    input = (friction_input_t){.period_ms = 3, .driven = true, .have_gyro = true};
}

void tearDown(void) {}

static friction_belief_t step(int16_t speed_mm_s_q4)
{
    input.speed_mm_s_q4 = speed_mm_s_q4;
    friction_take_motion(CONFIG, &state, speed_mm_s_q4, input.yaw_rate_mrad_s);
    return friction_step(CONFIG, &state, &input);
}

/* The last belief of so many steps at this speed. */
static friction_belief_t steps(int count, int16_t speed_mm_s_q4)
{
    friction_belief_t belief = FRICTION_MODEL;
    for (int i = 0; i < count; i++)
        belief = step(speed_mm_s_q4);
    return belief;
}

static int16_t takes_mv(int16_t surge_mv)
{
    return friction_takes_mv(CONFIG, &state, input.speed_mm_s_q4, surge_mv);
}

/* Drives for `ms` with a friction of `friction_mv`, of which the model has what is in force. */
static void drive(int32_t lost_mv, int ms, int16_t speed_mm_s_q4)
{
    for (int i = 0; i < ms / 3; i++) {
        const int32_t lacks_mv_q8 = (lost_mv - friction_mv(CONFIG, &state)) * 256;
        const int32_t faster = (int32_t)((int64_t)lacks_mv_q8 * 4 * 3 * Q17 / 1000 / CONFIG->mv_per_mm_s2_q10);
        input.innovation_mm_s_q17 = speed_mm_s_q4 < 0 ? -faster : faster;
        (void)step(speed_mm_s_q4);
    }
}

static void test_friction_is_learnt_soon_after_a_rest(void)
{
    drive(564, 200, CRUISE_Q4);
    TEST_ASSERT_INT16_WITHIN(25, 564, friction_mv(CONFIG, &state));
    drive(564, 200, CRUISE_Q4);
    TEST_ASSERT_INT16_WITHIN(2, 564, friction_mv(CONFIG, &state));
}

static void test_friction_follows_with_its_time_constant(void)
{
    drive(2000, 63, CRUISE_Q4); /* 1 / (16 / s) */
    TEST_ASSERT_INT32_WITHIN(60 * 16, 1264 * 16, state.learnt_mv_q4);
}

static void test_friction_falls_again_where_it_was_too_large(void)
{
    drive(1500, 200, CRUISE_Q4);
    drive(500, 200, CRUISE_Q4);
    TEST_ASSERT_INT16_WITHIN(50, 500, friction_mv(CONFIG, &state));
}

static void test_friction_is_the_same_backward_bit_for_bit(void)
{
    drive(700, 150, CRUISE_Q4);
    const int32_t learnt = state.learnt_mv_q4;
    const int16_t takes = takes_mv(1000);
    setUp();
    drive(700, 150, -CRUISE_Q4);
    TEST_ASSERT_EQUAL_INT32(learnt, state.learnt_mv_q4);
    TEST_ASSERT_EQUAL_INT16(-takes, takes_mv(-1000));
}

static void test_friction_saturates_and_never_drives(void)
{
    input.innovation_mm_s_q17 = INT32_MAX;
    steps(100, CRUISE_Q4);
    TEST_ASSERT_EQUAL_INT32(FRICTION_MOST_MV * 16L, state.learnt_mv_q4);
    TEST_ASSERT_EQUAL_INT16(FRICTION_MOST_MV, friction_mv(CONFIG, &state));
    input.innovation_mm_s_q17 = -INT32_MAX;
    steps(10, CRUISE_Q4);
    TEST_ASSERT_EQUAL_INT32(0, state.learnt_mv_q4);
    TEST_ASSERT_EQUAL_INT16(0, friction_mv(CONFIG, &state));
}

static void test_friction_that_a_bias_could_feign_is_not_in_force(void)
{
    const int32_t feigned_mv = FRICTION_BIAS_MM_S2 * 5 * (int32_t)CONFIG->mv_per_mm_s2_q10 / 2048;
    drive(feigned_mv - 5, 390, CRUISE_Q4);
    TEST_ASSERT_EQUAL_INT16(0, friction_mv(CONFIG, &state));
    setUp();
    drive(feigned_mv * 4 / 3 + 5, 390, CRUISE_Q4);
    TEST_ASSERT_EQUAL_INT32(state.learnt_mv_q4 / 16, friction_mv(CONFIG, &state));
}

static void test_friction_comes_into_force_without_a_jump(void)
{
    int32_t before = 0;
    for (int i = 0; i < 1000; i++) {
        state.trusted_ms = 0;
        input.innovation_mm_s_q17 = 4000 + 150 * i / 10; /* some mV in a step at most */
        (void)step(CRUISE_Q4);
        TEST_ASSERT_INT32_WITHIN(6, before, friction_mv(CONFIG, &state));
        before = friction_mv(CONFIG, &state);
    }
}

static void test_friction_is_not_learnt_late_slowly_in_a_turn_or_without_motors(void)
{
    input.innovation_mm_s_q17 = Q17;
    steps(10, FRICTION_SLOW_MM_S_Q4);
    TEST_ASSERT_EQUAL_INT32(0, state.learnt_mv_q4);
    input.yaw_rate_mrad_s = 8000; /* 560 mm/s on a side */
    steps(10, CRUISE_Q4);
    TEST_ASSERT_EQUAL_INT32(0, state.learnt_mv_q4);
    state.trusted_ms = FRICTION_TRUSTED_MS;
    input.yaw_rate_mrad_s = 0;
    TEST_ASSERT_EQUAL(FRICTION_MODEL, step(CRUISE_Q4));
    TEST_ASSERT_EQUAL_INT32(0, state.learnt_mv_q4);
    state.trusted_ms = 0;
    input.driven = false;
    TEST_ASSERT_EQUAL(FRICTION_MODEL, step(CRUISE_Q4));
    TEST_ASSERT_EQUAL_INT32(0, state.learnt_mv_q4);
}

static void test_friction_believes_the_accelerometer_for_a_time_after_a_rest(void)
{
    TEST_ASSERT_EQUAL(FRICTION_ACCELEROMETER, steps(FRICTION_TRUSTED_MS / 3, CRUISE_Q4));
    TEST_ASSERT_EQUAL(FRICTION_MODEL, steps(1, CRUISE_Q4));
    input.accel_mm_s2 = 200; /* a rest as told is no matter of the sensors */
    steps(FRICTION_SLOW_MS / 3, FRICTION_SLOW_MM_S_Q4);
    TEST_ASSERT_EQUAL(FRICTION_MODEL, step(CRUISE_Q4));
    steps(TOLD_MS / 3, FRICTION_SLOW_MM_S_Q4);
    TEST_ASSERT_EQUAL(FRICTION_ACCELEROMETER, step(CRUISE_Q4));
}

static void test_friction_sees_rest_where_a_slow_robot_is_quiet(void)
{
    TEST_ASSERT_EQUAL(FRICTION_ACCELEROMETER, steps(FRICTION_REST_STEPS - 1, 600));
    TEST_ASSERT_EQUAL(FRICTION_REST, step(600));
    TEST_ASSERT_EQUAL(FRICTION_ACCELEROMETER, step(600));
}

static void test_friction_sees_rest_through_noise(void)
{
    static const int16_t NOISE[] = {38, -38, 0, 0, 38, -76, 0, 38}; /* resolutions of the accelerometer */
    int rests = 0;
    for (int i = 0; i < 4 * FRICTION_REST_STEPS; i++) {
        input.accel_mm_s2 = NOISE[i & 7];
        input.yaw_rate_mrad_s = (int16_t)(i % 3 * 20 - 20);
        rests += step(-600) == FRICTION_REST;
    }
    TEST_ASSERT_EQUAL(4, rests);
}

/* How often rest is seen in one second at this speed. */
static int rests_seen(int16_t speed_mm_s_q4)
{
    int rests = 0;
    for (int i = 0; i < 333; i++)
        rests += step(speed_mm_s_q4) == FRICTION_REST;
    return rests;
}

static void test_friction_sees_no_rest_in_a_cruise(void)
{
    TEST_ASSERT_EQUAL(0, rests_seen(CRUISE_Q4));
    TEST_ASSERT_EQUAL(0, rests_seen(-CRUISE_Q4));
    TEST_ASSERT_EQUAL(0, rests_seen(1280)); /* creep */
    TEST_ASSERT_EQUAL(0, rests_seen(FRICTION_SLOW_MM_S_Q4 + 1));
}

static void test_friction_sees_no_rest_where_something_moves_or_is_missing(void)
{
    input.accel_mm_s2 = 25; /* a gentle start: each reading is within the noise */
    TEST_ASSERT_EQUAL(0, rests_seen(0));
    setUp();
    input.accel_mm_s2 = -25;
    TEST_ASSERT_EQUAL(0, rests_seen(0));
    setUp();
    input.yaw_rate_mrad_s = -61;
    TEST_ASSERT_EQUAL(0, rests_seen(0));
    setUp();
    input.have_gyro = false;
    TEST_ASSERT_EQUAL(0, rests_seen(0));
    setUp();
    input.driven = false; /* the heading's estimator sees this rest */
    TEST_ASSERT_EQUAL(0, rests_seen(0));
}

static void test_friction_begins_anew_after_a_disturbed_rest(void)
{
    steps(FRICTION_REST_STEPS - 1, 0);
    input.accel_mm_s2 = 300;
    (void)step(0);
    input.accel_mm_s2 = 0;
    TEST_ASSERT_EQUAL(FRICTION_MODEL, steps(FRICTION_REST_STEPS - 1, 0));
    TEST_ASSERT_EQUAL(FRICTION_REST, step(0));
}

static void test_friction_takes_from_the_motors_along_the_motion(void)
{
    drive(800, 390, CRUISE_Q4);
    const int16_t all = friction_mv(CONFIG, &state);
    TEST_ASSERT_EQUAL_INT16(all, takes_mv(-3000));
    input.speed_mm_s_q4 = -FRICTION_STILL_MM_S_Q4;
    friction_take_motion(CONFIG, &state, input.speed_mm_s_q4, 0);
    TEST_ASSERT_EQUAL_INT16(-all, takes_mv(3000));
    friction_take_motion(CONFIG, &state, 200, 4000);
    TEST_ASSERT_EQUAL_INT16(0, takes_mv(3000));
}

static void test_friction_holds_a_robot_at_rest(void)
{
    drive(800, 390, CRUISE_Q4);
    friction_take_motion(CONFIG, &state, FRICTION_STILL_MM_S_Q4 - 1, 0);
    TEST_ASSERT_EQUAL_INT16(10, takes_mv(10));
    TEST_ASSERT_EQUAL_INT16(-10, takes_mv(-10));
    TEST_ASSERT_EQUAL_INT16(friction_mv(CONFIG, &state), takes_mv(32767));
    TEST_ASSERT_EQUAL_INT16(-friction_mv(CONFIG, &state), takes_mv(-32767));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_friction_is_learnt_soon_after_a_rest);
    RUN_TEST(test_friction_follows_with_its_time_constant);
    RUN_TEST(test_friction_falls_again_where_it_was_too_large);
    RUN_TEST(test_friction_is_the_same_backward_bit_for_bit);
    RUN_TEST(test_friction_saturates_and_never_drives);
    RUN_TEST(test_friction_that_a_bias_could_feign_is_not_in_force);
    RUN_TEST(test_friction_comes_into_force_without_a_jump);
    RUN_TEST(test_friction_is_not_learnt_late_slowly_in_a_turn_or_without_motors);
    RUN_TEST(test_friction_believes_the_accelerometer_for_a_time_after_a_rest);
    RUN_TEST(test_friction_sees_rest_where_a_slow_robot_is_quiet);
    RUN_TEST(test_friction_sees_rest_through_noise);
    RUN_TEST(test_friction_sees_no_rest_in_a_cruise);
    RUN_TEST(test_friction_sees_no_rest_where_something_moves_or_is_missing);
    RUN_TEST(test_friction_begins_anew_after_a_disturbed_rest);
    RUN_TEST(test_friction_takes_from_the_motors_along_the_motion);
    RUN_TEST(test_friction_holds_a_robot_at_rest);
    return UNITY_END();
}
