#include "twin.h"

void setUp(void)
{
    twin_new(BP_DIFF_DRIVE);
}
void tearDown(void)
{
    twin_free();
}

static const double ERROR = -0.06;

static void test_all_readings_of_both_wheels_are_scaled(void)
{
    const bp_state rolled = {.wheel_angle = {3, -4}};
    begin("encoder_scale", &ERROR, &rolled);
    go(6, -3, 0.9);
    for (int i = OUTPUT_WHEEL_SPEED_LEFT; i <= OUTPUT_WHEEL_VELOCITY_RIGHT; i++) {
        TEST_ASSERT_TRUE(truth[i] * truth[i] > 1e-4);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.94 * truth[i], seen[i]);
    }
    assert_only(OUTPUT_WHEEL_SPEED_LEFT, OUTPUT_WHEEL_VELOCITY_RIGHT);
}

static void test_a_motor_has_its_four_readings_scaled(void)
{
    twin_free();
    twin_new(BP_MOTOR);
    bp_model_set(plain, "wheel_radius", 0.02);
    bp_model_set(changed, "wheel_radius", 0.02);
    begin("encoder_scale", &ERROR, NULL);
    go(6, 0, 0.9);
    for (int i = OUTPUT_SPEED; i <= OUTPUT_VELOCITY; i++) {
        TEST_ASSERT_TRUE(truth[i] > 0.01);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.94 * truth[i], seen[i]);
    }
    assert_only(OUTPUT_SPEED, OUTPUT_VELOCITY);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_all_readings_of_both_wheels_are_scaled);
    RUN_TEST(test_a_motor_has_its_four_readings_scaled);
    return UNITY_END();
}
