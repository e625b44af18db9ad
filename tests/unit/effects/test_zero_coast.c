#include "drive.h"

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

/* 1/s: how fast the motors alone stop the vehicle, both shorted. */
static double braking(void)
{
    return 2 * EMF_LOSS / (RADIUS * RADIUS) / surge_mass();
}

static void test_a_share_of_the_braking_is_missing_at_zero_command(void)
{
    static const double SHARES[] = {0, 0.3, 0.8, 1};
    for (int i = 0; i < 4; i++)
        for (int sign = -1; sign <= 1; sign += 2) {
            const bp_state moving = {.surge = sign * 0.4};
            on("zero_coast", SHARES[i], 0, 0);
            start(&moving);
            go(0, 0, 0.3);
            TEST_ASSERT_DOUBLE_WITHIN(2e-5, sign * 0.4 * exp(-(1 - SHARES[i]) * braking() * 0.3), state()->surge);
        }
}

/* The back EMF is that of the middle of a step, so that long steps do too. */
static void test_long_steps_coast_alike(void)
{
    const bp_state moving = {.surge = 0.4};
    const double expected = 0.4 * exp(-0.4 * braking() * 0.3);
    on("zero_coast", 0.6, 0, 0);
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, &moving, 0.003, 0.003));
    go(0, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4 * expected, expected, state()->surge);
}

static void test_a_turn_coasts_too(void)
{
    const bp_state turning = {.yaw_rate = 3};
    on("zero_coast", 1, 0, 0);
    start(&turning);
    go(0, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 3, state()->yaw_rate);
}

static void test_other_commands_pass(void)
{
    start(NULL);
    go(5, -3, 0.6);
    const bp_state plain = *state();
    on("zero_coast", 1, 0, 0);
    start(NULL);
    go(5, -3, 0.6);
    TEST_ASSERT_EQUAL_MEMORY(&plain, state(), sizeof plain);
    start(NULL);
    go(0.1, NAN, 0.003);
    TEST_ASSERT_EQUAL_DOUBLE(0.1, plant.vehicle.voltage[0]);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[1]));
}

static void test_it_is_off_at_zero(void)
{
    assert_off("zero_coast", 0, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_share_of_the_braking_is_missing_at_zero_command);
    RUN_TEST(test_long_steps_coast_alike);
    RUN_TEST(test_a_turn_coasts_too);
    RUN_TEST(test_other_commands_pass);
    RUN_TEST(test_it_is_off_at_zero);
    return UNITY_END();
}
