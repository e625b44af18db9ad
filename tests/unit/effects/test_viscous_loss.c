#include "drive.h"

void setUp(void)
{
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

static void test_speed_and_turn_decay_exponentially(void)
{
    const double drag = 4e-4, surge = 2 * drag / (RADIUS * RADIUS), yaw = surge * HALF_TRACK * HALF_TRACK;
    on("viscous_loss", drag, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        coast(sign * 0.4, 0, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, sign * 0.4 * exp(-surge / surge_mass() * 0.6), state()->surge);
        coast(0, sign * 3, 0.6);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, sign * 3 * exp(-yaw / turn_inertia() * 0.6), state()->yaw_rate);
    }
}

static void test_an_axis_loses_a_force(void)
{
    const bp_state moving = {.wheel_speed = {2}};
    axis();
    on("viscous_loss", 30, 0, 0);
    start(&moving);
    go(0, 0, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 2 * exp(-30 * 3 / 100.0), state()->wheel_speed[0]);
}

static void test_it_is_off_at_zero(void)
{
    assert_off("viscous_loss", 0, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_speed_and_turn_decay_exponentially);
    RUN_TEST(test_an_axis_loses_a_force);
    RUN_TEST(test_it_is_off_at_zero);
    return UNITY_END();
}
