#include "app/params_gen.h"
#include "model/motor.h"
#include "unity.h"

static const motor_coefficients_t *const MOTOR = &MODEL_PAPER.motor[0];
static motor_state_t state;

void setUp(void)
{
    state = (motor_state_t){0, 0};
}
void tearDown(void) {}

static void run(int16_t voltage_mv, int steps)
{
    for (int i = 0; i < steps; i++)
        motor_step(MOTOR, &state, voltage_mv, 0);
}

/* w = V / (K_e + R b / K_t), i = b w / K_t, with b = b_s + m g sigma r_w^2 = 2.3845e-4: values of rcx.toml by hand. */
static void test_motor_reaches_the_steady_speed_and_current_of_the_equations(void)
{
    run(4500, 1000);
    TEST_ASSERT_INT32_WITHIN(16552 / 2000, 16552, state.speed_mrad_s_q13 / 8192);
    TEST_ASSERT_INT32_WITHIN(20, 20241, state.current_ua_q7 / 128);
}

static void test_motor_gains_most_of_its_stall_current_in_one_step(void)
{
    run(4500, 1);
    TEST_ASSERT_INT32_WITHIN(6000, 193000, state.current_ua_q7 / 128);
}

static void test_motor_shorted_comes_to_rest(void)
{
    run(9000, 1000);
    run(0, 3000);
    TEST_ASSERT_INT32_WITHIN(8192 / 100, 0, state.speed_mrad_s_q13);
    TEST_ASSERT_INT32_WITHIN(128 / 10, 0, state.current_ua_q7);
}

static void test_motor_is_the_same_backward_bit_for_bit(void)
{
    motor_state_t forward;
    run(8765, 77);
    forward = state;
    setUp();
    run(-8765, 77);
    TEST_ASSERT_EQUAL_INT32(-forward.speed_mrad_s_q13, state.speed_mrad_s_q13);
    TEST_ASSERT_EQUAL_INT32(-forward.current_ua_q7, state.current_ua_q7);
}

static void test_motor_with_a_load_loses_the_speed_the_load_takes(void)
{
    motor_state_t loaded;
    run(4500, 100);
    loaded = state;
    run(4500, 1);
    motor_step(MOTOR, &loaded, 4500, -8192000);
    TEST_ASSERT_EQUAL_INT32(state.speed_mrad_s_q13 - 8192000, loaded.speed_mrad_s_q13);
}

static void test_motor_speed_saturates_at_96_rad_s(void)
{
    state.speed_mrad_s_q13 = MOTOR_SPEED_LIMIT_MRAD_S_Q13;
    motor_step(MOTOR, &state, MOTOR_VOLTAGE_LIMIT_MV, 20 * 8192000);
    TEST_ASSERT_EQUAL_INT32(MOTOR_SPEED_LIMIT_MRAD_S_Q13, state.speed_mrad_s_q13);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_motor_reaches_the_steady_speed_and_current_of_the_equations);
    RUN_TEST(test_motor_gains_most_of_its_stall_current_in_one_step);
    RUN_TEST(test_motor_shorted_comes_to_rest);
    RUN_TEST(test_motor_is_the_same_backward_bit_for_bit);
    RUN_TEST(test_motor_with_a_load_loses_the_speed_the_load_takes);
    RUN_TEST(test_motor_speed_saturates_at_96_rad_s);
    return UNITY_END();
}
