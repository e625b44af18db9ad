#include "drive.h"

static const double LOST = 0.8, RESISTANCE = 22, EMF = 0.245;

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

static double wheel_of(double surge)
{
    return surge / RADIUS;
}

/* 1/s: how fast the motors alone stop the vehicle, both shorted. */
static double braking(void)
{
    return 2 * EMF_LOSS / (RADIUS * RADIUS) / surge_mass();
}

static void test_a_stalled_motor_has_what_is_left_of_the_voltage(void)
{
    set("wheel_inertia", 1e4);
    on("dead_time", LOST, 0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        start(NULL);
        go(sign * 3, sign * 0.7, 0.3);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, sign * (3 - LOST) / RESISTANCE, state()->current[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, state()->current[1]);
    }
}

/* w' = -braking (w - LOST / K_e) down to LOST / K_e, and no current below. */
static void test_a_shorted_motor_stops_braking_where_its_back_emf_is_lost(void)
{
    on("dead_time", LOST, 0, 0);
    const double end = LOST / EMF, begin = wheel_of(0.5), t = 0.15;
    for (int sign = -1; sign <= 1; sign += 2) {
        const bp_state moving = {.surge = sign * 0.5};
        start(&moving);
        go(0, 0, t);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, sign * (end + (begin - end) * exp(-braking() * t)), state()->wheel_speed[0]);
        go(0, 0, 20 / braking());
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, sign * end, state()->wheel_speed[0]);
    }
    const bp_state slow = {.surge = 0.9 * RADIUS * end};
    start(&slow);
    go(0, 0, 1.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.9 * end, state()->wheel_speed[0]);
}

static void test_the_final_speed_lacks_what_is_lost(void)
{
    on("dead_time", LOST, 0, 0);
    start(NULL);
    go(-6, -6, 20 / braking());
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -(6 - LOST) / EMF, state()->wheel_speed[0]);
}

static void test_it_is_off_at_zero_and_where_the_drive_closes_a_current_loop(void)
{
    assert_off("dead_time", 0, 0, 0);
    axis();
    assert_off("dead_time", LOST, 0, 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_stalled_motor_has_what_is_left_of_the_voltage);
    RUN_TEST(test_a_shorted_motor_stops_braking_where_its_back_emf_is_lost);
    RUN_TEST(test_the_final_speed_lacks_what_is_lost);
    RUN_TEST(test_it_is_off_at_zero_and_where_the_drive_closes_a_current_loop);
    return UNITY_END();
}
