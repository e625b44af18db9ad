#include <math.h>

#include "app/params_gen.h"
#include "model/body.h"
#include "wire/crc.h"
#include "unity.h"

static const body_coefficients_t *const COUPLED = &MODEL_COUPLED;
static const body_coefficients_t *const PAPER = &MODEL_PAPER;
static body_state_t state;

void setUp(void)
{
    state = (body_state_t){.heading_bam32 = 0};
}
void tearDown(void) {}

static body_state_t run(const body_coefficients_t *coefficients, int16_t left_mv, int16_t right_mv, int steps)
{
    for (int i = 0; i < steps; i++)
        body_step(coefficients, &state, left_mv, right_mv);
    return state;
}

/* A curve, a reversal of one wheel, and a coast. */
static body_state_t tour(const body_coefficients_t *coefficients, int16_t left_mv, int16_t right_mv)
{
    setUp();
    run(coefficients, left_mv, right_mv, 400);
    run(coefficients, left_mv, (int16_t)-right_mv, 150);
    return run(coefficients, 0, 0, 100);
}

static void assert_left_and_right_mirror(const body_coefficients_t *coefficients)
{
    body_wheels_t wheels, mirrored;
    setUp();
    body_state_t one = run(coefficients, 6001, 4502, 500);
    setUp();
    body_state_t other = run(coefficients, 4502, 6001, 500);
    body_wheels(coefficients, &one, &wheels);
    body_wheels(coefficients, &other, &mirrored);
    TEST_ASSERT_NOT_EQUAL_INT32(0, one.y_um);
    TEST_ASSERT_EQUAL_INT32(one.x_um, other.x_um);
    TEST_ASSERT_EQUAL_INT32(one.y_um, -other.y_um);
    TEST_ASSERT_EQUAL_UINT32(one.heading_bam32, 0U - other.heading_bam32);
    TEST_ASSERT_EQUAL_INT32(one.motion.surge_mm_s_q17, other.motion.surge_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(one.motion.sway_mm_s_q17, -other.motion.sway_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(one.motion.yaw_rate_mrad_s_q12, -other.motion.yaw_rate_mrad_s_q12);
    TEST_ASSERT_EQUAL_INT32(wheels.left_mrad_s_q13, mirrored.right_mrad_s_q13);
    TEST_ASSERT_EQUAL_INT32(wheels.right_current_ua_q7, mirrored.left_current_ua_q7);
}

static void test_body_left_and_right_mirror_bit_for_bit(void)
{
    assert_left_and_right_mirror(COUPLED);
    assert_left_and_right_mirror(PAPER);
}

static void test_coupled_forward_and_backward_mirror_bit_for_bit(void)
{
    const body_state_t forward = tour(COUPLED, 6000, 5000);
    const body_state_t backward = tour(COUPLED, -6000, -5000);
    TEST_ASSERT_NOT_EQUAL_INT32(0, forward.y_um);
    TEST_ASSERT_EQUAL_INT32(forward.x_um, -backward.x_um);
    TEST_ASSERT_EQUAL_INT32(forward.y_um, backward.y_um);
    TEST_ASSERT_EQUAL_UINT32(forward.heading_bam32, 0U - backward.heading_bam32);
    TEST_ASSERT_EQUAL_INT32(forward.motion.surge_mm_s_q17, -backward.motion.surge_mm_s_q17);
}

static void test_paper_forward_and_backward_mirror_bit_for_bit_on_the_straight(void)
{
    const body_state_t forward = run(PAPER, 5000, 5000, 700);
    setUp();
    const body_state_t backward = run(PAPER, -5000, -5000, 700);
    TEST_ASSERT_GREATER_THAN_INT32(700000, forward.x_um);
    TEST_ASSERT_EQUAL_INT32(forward.x_um, -backward.x_um);
    TEST_ASSERT_EQUAL_INT32(forward.motion.surge_mm_s_q17, -backward.motion.surge_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(0, backward.y_um);
}

/* Fault 1: half voltage gives 1.54 m/s in 7 s, against a rim speed of 0.67. */
static void test_paper_outruns_its_wheels_and_coupled_does_not(void)
{
    run(PAPER, 4500, 4500, 2333);
    TEST_ASSERT_INT32_WITHIN(40, 1540, state.motion.surge_mm_s_q17 / 131072);
    setUp();
    run(COUPLED, 4500, 4500, 2333);
    TEST_ASSERT_INT32_WITHIN(10, 670, state.motion.surge_mm_s_q17 / 131072);
}

/* Fault 3: thrust follows the velocity. */
static void test_paper_is_driven_sideways_by_a_little_sway(void)
{
    state.velocity_y_mm_s_q17 = state.motion.sway_mm_s_q17 = 131072;
    run(PAPER, 9000, 9000, 300);
    TEST_ASSERT_GREATER_THAN_INT32(50 * 131072, state.motion.sway_mm_s_q17);
    TEST_ASSERT_INT32_WITHIN(131072, 0, state.motion.surge_mm_s_q17);
}

/* Fault 4: nothing damps yaw. */
static void test_paper_spin_goes_on_and_coupled_spin_stops(void)
{
    run(PAPER, 4500, -4500, 1000);
    run(PAPER, 0, 0, 300);
    const int32_t spin = state.motion.yaw_rate_mrad_s_q12;
    run(PAPER, 0, 0, 1000);
    TEST_ASSERT_EQUAL_INT32(spin, state.motion.yaw_rate_mrad_s_q12);
    TEST_ASSERT_GREATER_THAN_INT32(1000 * 4096, spin);
    setUp();
    run(COUPLED, 4500, -4500, 1000);
    run(COUPLED, 0, 0, 2000);
    TEST_ASSERT_INT32_WITHIN(4096 / 10, 0, state.motion.yaw_rate_mrad_s_q12);
}

static void test_paper_at_rest_is_pushed_along_its_heading(void)
{
    state.heading_bam32 = 0x40000000U;
    run(PAPER, 9000, 9000, 30);
    TEST_ASSERT_GREATER_THAN_INT32(100, state.y_um);
    TEST_ASSERT_EQUAL_INT32(0, state.x_um);
}

static void test_paper_crawling_below_the_rest_speed_has_no_direction(void)
{
    state.velocity_y_mm_s_q17 = state.motion.sway_mm_s_q17 = BODY_REST_SPEED_MM_S_Q17 / 2;
    run(PAPER, 9000, 9000, 1);
    TEST_ASSERT_GREATER_THAN_INT32(BODY_REST_SPEED_MM_S_Q17, state.motion.surge_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(BODY_REST_SPEED_MM_S_Q17 / 2, state.velocity_y_mm_s_q17);
}

static void test_paper_moving_backward_is_pushed_ahead(void)
{
    state.velocity_x_mm_s_q17 = state.motion.surge_mm_s_q17 = -100 * 131072;
    run(PAPER, 9000, 9000, 20);
    TEST_ASSERT_GREATER_THAN_INT32(-100 * 131072, state.motion.surge_mm_s_q17);
}

static void test_body_with_the_left_wheel_faster_turns_right(void)
{
    run(COUPLED, 4500, 1500, 100);
    TEST_ASSERT_GREATER_THAN_INT32(1000 * 4096, state.motion.yaw_rate_mrad_s_q12);
    TEST_ASSERT_GREATER_THAN_INT32(0, state.y_um);
    setUp();
    run(PAPER, 4500, 1500, 100);
    TEST_ASSERT_GREATER_THAN_INT32(100 * 4096, state.motion.yaw_rate_mrad_s_q12);
}

static void test_body_clamps_voltages_beyond_its_range(void)
{
    run(COUPLED, INT16_MAX, INT16_MIN, 50);
    const body_state_t beyond = state;
    setUp();
    run(COUPLED, 16383, -16383, 50);
    TEST_ASSERT_EQUAL_INT32(state.motion.yaw_rate_mrad_s_q12, beyond.motion.yaw_rate_mrad_s_q12);
}

static void test_body_saturates_and_never_wraps(void)
{
    for (int i = 0; i < 60; i++) {
        run(PAPER, INT16_MAX, INT16_MIN, 500);
        TEST_ASSERT_GREATER_OR_EQUAL_INT32(0, state.motion.yaw_rate_mrad_s_q12);
    }
    TEST_ASSERT_EQUAL_INT32(BODY_YAW_RATE_LIMIT_MRAD_S_Q12, state.motion.yaw_rate_mrad_s_q12);
    setUp();
    state.velocity_x_mm_s_q17 = state.motion.surge_mm_s_q17 = BODY_SPEED_LIMIT_MM_S_Q17;
    state.x_um = INT32_MAX - 10;
    run(PAPER, INT16_MAX, INT16_MAX, 100);
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, state.x_um);
    TEST_ASSERT_LESS_OR_EQUAL_INT32(BODY_SPEED_LIMIT_MM_S_Q17, state.motion.surge_mm_s_q17);
}

static void assert_surge_takes_a_correction(const body_coefficients_t *coefficients)
{
    setUp();
    run(coefficients, 4500, 4500, 200);
    const int32_t before = state.motion.surge_mm_s_q17;
    body_correct_surge(coefficients, &state, 20 * 131072);
    TEST_ASSERT_INT32_WITHIN(200, before + 20 * 131072, state.motion.surge_mm_s_q17);
    run(coefficients, 4500, 4500, 1);
    TEST_ASSERT_INT32_WITHIN(3 * 131072, before + 20 * 131072, state.motion.surge_mm_s_q17);
    body_correct_surge(coefficients, &state, -BODY_SPEED_LIMIT_MM_S_Q17);
    body_correct_surge(coefficients, &state, -BODY_SPEED_LIMIT_MM_S_Q17);
    TEST_ASSERT_LESS_THAN_INT32(-3000 * 131072, state.motion.surge_mm_s_q17);
}

static void test_body_surge_takes_a_correction_and_keeps_it(void)
{
    assert_surge_takes_a_correction(COUPLED);
    assert_surge_takes_a_correction(PAPER);
}

static void test_body_heading_is_rounded_to_the_nearest(void)
{
    state.heading_bam32 = 0x12348000U;
    TEST_ASSERT_EQUAL_UINT16(0x1235, body_heading_bam16(&state));
    state.heading_bam32 = 0U - 0x12348000U;
    TEST_ASSERT_EQUAL_UINT16((uint16_t)-0x1235, body_heading_bam16(&state));
}

/* The same tour with the robot turned by an odd angle first, seen from there. */
static void assert_no_direction_is_special(const body_coefficients_t *coefficients, int16_t left_mv, int16_t right_mv)
{
    static const uint32_t TURNED_BAM32 = 0x13579BDFU;
    const double angle = TURNED_BAM32 / 4294967296.0 * 6.283185307179586;
    const body_state_t one = tour(coefficients, left_mv, right_mv);
    setUp();
    state.heading_bam32 = TURNED_BAM32;
    run(coefficients, left_mv, right_mv, 400);
    run(coefficients, left_mv, (int16_t)-right_mv, 150);
    const body_state_t other = run(coefficients, 0, 0, 100);
    TEST_ASSERT_INT32_WITHIN(131072, one.motion.surge_mm_s_q17, other.motion.surge_mm_s_q17);
    TEST_ASSERT_INT32_WITHIN(131072, one.motion.sway_mm_s_q17, other.motion.sway_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(one.motion.yaw_rate_mrad_s_q12, other.motion.yaw_rate_mrad_s_q12);
    TEST_ASSERT_INT32_WITHIN(1000, (int32_t)(one.x_um * cos(angle) - one.y_um * sin(angle)), other.x_um);
    TEST_ASSERT_INT32_WITHIN(1000, (int32_t)(one.x_um * sin(angle) + one.y_um * cos(angle)), other.y_um);
}

static void test_body_drives_alike_in_every_direction(void)
{
    assert_no_direction_is_special(COUPLED, 6000, 5000);
    assert_no_direction_is_special(COUPLED, -6000, -5000);
    assert_no_direction_is_special(PAPER, 6000, 5000);
    assert_no_direction_is_special(PAPER, -6000, -5000);
}

static uint16_t crc_of_tour(const body_coefficients_t *coefficients)
{
    const body_state_t end = tour(coefficients, 6001, -4502);
    const int32_t values[] = {end.x_um,
                              end.y_um,
                              (int32_t)end.heading_bam32,
                              end.motion.surge_mm_s_q17,
                              end.motion.sway_mm_s_q17,
                              end.motion.yaw_rate_mrad_s_q12,
                              end.x_rest_um_q12,
                              end.y_rest_um_q12,
                              end.motor[0].speed_mrad_s_q13,
                              end.motor[1].speed_mrad_s_q13};
    uint16_t crc = CRC_START;
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++)
        crc = crc_of_number(crc_of_number(crc, (uint16_t)values[i]), (uint16_t)((uint32_t)values[i] >> 16));
    return crc;
}

/* Every brick has the same model to the bit. A change here changes every golden stream. */
static void test_body_ends_its_tour_in_this_state_to_the_bit(void)
{
    TEST_ASSERT_EQUAL_HEX16(0x50C8, crc_of_tour(COUPLED));
    TEST_ASSERT_EQUAL_HEX16(0x1400, crc_of_tour(PAPER));
}

static void test_body_has_coefficients_of_its_own_for_each_motor(void)
{
    body_coefficients_t weak = *PAPER;
    weak.motor[1] = (motor_coefficients_t){0};
    const body_state_t both = run(PAPER, 6000, 6000, 100);
    setUp();
    run(&weak, 6000, 6000, 100);
    TEST_ASSERT_EQUAL_INT32(both.motor[0].speed_mrad_s_q13, state.motor[0].speed_mrad_s_q13);
    TEST_ASSERT_EQUAL_INT32(0, state.motor[1].speed_mrad_s_q13);
    weak = *COUPLED;
    weak.motor[1] = (motor_coefficients_t){0};
    setUp();
    run(&weak, 6000, -6000, 100);
    TEST_ASSERT_EQUAL_INT32(0, state.motion.yaw_rate_mrad_s_q12);
}

static void test_body_corrections_end_at_the_limits(void)
{
    for (int i = 0; i < 8; i++)
        body_correct_surge(COUPLED, &state, BODY_SPEED_LIMIT_MM_S_Q17);
    TEST_ASSERT_EQUAL_INT32(MOTOR_SPEED_LIMIT_MRAD_S_Q13, state.motor[0].speed_mrad_s_q13);
    setUp();
    for (int i = 0; i < 2; i++)
        body_correct_surge(PAPER, &state, BODY_SPEED_LIMIT_MM_S_Q17);
    TEST_ASSERT_EQUAL_INT32(BODY_SPEED_LIMIT_MM_S_Q17, state.motion.surge_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(BODY_SPEED_LIMIT_MM_S_Q17, state.velocity_x_mm_s_q17);
    setUp();
    state.heading_bam32 = 0x40000000U; /* a quarter turn: along y */
    body_correct_surge(PAPER, &state, 131072);
    TEST_ASSERT_INT32_WITHIN(4, 131072, state.velocity_y_mm_s_q17);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_body_left_and_right_mirror_bit_for_bit);
    RUN_TEST(test_coupled_forward_and_backward_mirror_bit_for_bit);
    RUN_TEST(test_paper_forward_and_backward_mirror_bit_for_bit_on_the_straight);
    RUN_TEST(test_paper_outruns_its_wheels_and_coupled_does_not);
    RUN_TEST(test_paper_is_driven_sideways_by_a_little_sway);
    RUN_TEST(test_paper_spin_goes_on_and_coupled_spin_stops);
    RUN_TEST(test_paper_at_rest_is_pushed_along_its_heading);
    RUN_TEST(test_paper_crawling_below_the_rest_speed_has_no_direction);
    RUN_TEST(test_paper_moving_backward_is_pushed_ahead);
    RUN_TEST(test_body_with_the_left_wheel_faster_turns_right);
    RUN_TEST(test_body_clamps_voltages_beyond_its_range);
    RUN_TEST(test_body_saturates_and_never_wraps);
    RUN_TEST(test_body_surge_takes_a_correction_and_keeps_it);
    RUN_TEST(test_body_heading_is_rounded_to_the_nearest);
    RUN_TEST(test_body_drives_alike_in_every_direction);
    RUN_TEST(test_body_ends_its_tour_in_this_state_to_the_bit);
    RUN_TEST(test_body_has_coefficients_of_its_own_for_each_motor);
    RUN_TEST(test_body_corrections_end_at_the_limits);
    return UNITY_END();
}
