#include "drive.h"

static const double INERTIA = 0.01, TORQUE = 0.5, LEVEL = -0.9; /* kg m^2, N m, rad */

void setUp(void)
{
    vehicle(BP_MOTOR, BP_COUPLED);
    set("wheel_inertia", INERTIA);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

static double energy(double angle, double speed)
{
    return 0.5 * INERTIA * speed * speed + TORQUE * sin(angle - LEVEL);
}

static void test_an_arm_swings_without_loss(void)
{
    const bp_state raised = {.wheel_angle = {0.2}};
    on("gravity_load", TORQUE, LEVEL, 0);
    start(&raised);
    const double before = energy(0.2, 0);
    double least = 0, most = 0;
    for (int i = 0; i < 500; i++) {
        go(NAN, 0, BODY_STEP);
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, before, energy(out[OUTPUT_ANGLE], out[OUTPUT_SPEED]));
        least = fmin(least, out[OUTPUT_ANGLE]);
        most = fmax(most, out[OUTPUT_SPEED]);
    }
    TEST_ASSERT_TRUE(most > 3);
    TEST_ASSERT_TRUE(least < -1);
}

/* It hangs a quarter of a turn below the level. */
static void test_it_hangs_at_rest(void)
{
    const bp_state hanging = {.wheel_angle = {LEVEL - 1.5707963267948966}};
    on("gravity_load", TORQUE, LEVEL, 0);
    start(&hanging);
    go(NAN, 0, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, out[OUTPUT_SPEED]);
}

static void test_a_carriage_does_not_know_it(void)
{
    axis();
    assert_off("gravity_load", TORQUE, LEVEL, 0);
}

/* Each wheel at its own angle: what both have at the start pulls a quarter of a turn further on. */
static void test_wheels_out_of_balance_pull_a_robot(void)
{
    const bp_state apart = {.wheel_angle = {0, 3.14159265358979}};
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
    on("gravity_load", 0.01, 0, 0);
    start(&apart);
    go(NAN, NAN, 0.03);
    TEST_ASSERT_TRUE(state()->wheel_speed[0] < -0.1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -state()->wheel_speed[0], state()->wheel_speed[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_an_arm_swings_without_loss);
    RUN_TEST(test_it_hangs_at_rest);
    RUN_TEST(test_a_carriage_does_not_know_it);
    RUN_TEST(test_wheels_out_of_balance_pull_a_robot);
    return UNITY_END();
}
