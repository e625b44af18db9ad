#include "drive.h"

static const double SHARE = 0.25, EMF = 0.245;

void setUp(void)
{
    vehicle(BP_DIFF_DRIVE, BP_COUPLED);
    set("inductance", 0);
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

/* 1/s: how fast the vehicle takes on the speed of its motors. */
static double rate(void)
{
    return 2 * EMF_LOSS / (RADIUS * RADIUS) / surge_mass();
}

/* w' = (1 - share) rate (V / K_e - w): the final speed is the same, the way to it longer. */
static void test_a_share_of_the_torque_is_lost_while_it_drives(void)
{
    on("load_friction", SHARE, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        start(NULL);
        go(sign * 6, sign * 6, 0.3);
        const double expected = 6 / EMF * (1 - exp(-(1 - SHARE) * rate() * 0.3));
        TEST_ASSERT_DOUBLE_WITHIN(2e-3 * expected, sign * expected, state()->wheel_speed[0]);
        go(sign * 6, sign * 6, 30 / rate());
        TEST_ASSERT_DOUBLE_WITHIN(1e-2, sign * 6 / EMF, state()->wheel_speed[0]);
    }
}

/* w' = -(1 + share) rate w. */
static void test_it_adds_to_the_torque_that_brakes(void)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        const bp_state moving = {.surge = sign * 0.4};
        on("load_friction", SHARE, 0, 0);
        start(&moving);
        go(0, 0, 0.15);
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, sign * 0.4 * exp(-(1 + SHARE) * rate() * 0.15), state()->surge);
    }
}

static void test_a_motor_that_floats_has_no_such_friction(void)
{
    on("load_friction", 0.9, 0, 0);
    coast(0.4, 2, 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4, state()->surge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2, state()->yaw_rate);
}

/* 50 N/V on 100 kg: a force of 100 N moves it with 1 - share of that. */
static void test_a_commanded_force_counts(void)
{
    axis();
    on("load_friction", SHARE, 0, 0);
    start(NULL);
    go(2, 0, 1.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, (1 - SHARE) * 1.5, state()->wheel_speed[0]);
}

static void test_it_is_off_at_zero(void)
{
    assert_off("load_friction", 0, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_share_of_the_torque_is_lost_while_it_drives);
    RUN_TEST(test_it_adds_to_the_torque_that_brakes);
    RUN_TEST(test_a_motor_that_floats_has_no_such_friction);
    RUN_TEST(test_a_commanded_force_counts);
    RUN_TEST(test_it_is_off_at_zero);
    return UNITY_END();
}
