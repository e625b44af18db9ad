#include "affected.h"

static const double INERTIA = 1e-4 + 0.45 * 0.04 * 0.04;
static const double TURN = 6.283185307179586;

static void make_free_motor(const double *values)
{
    make_motor("cogging", values);
    set("viscous_friction", 0);
    set("drag_area", 0);
}

static double energy(const double *values)
{
    const bp_state *state = &plant.vehicle.state;
    return 0.5 * INERTIA * state->wheel_speed[0] * state->wheel_speed[0] -
           values[0] / values[1] * cos(values[1] * state->wheel_angle[0] + values[2]);
}

static void test_a_floating_motor_keeps_its_energy(void)
{
    const double values[] = {0.02, 6, 0.4, 0};
    const bp_state moving = {.wheel_speed = {6}};
    make_free_motor(values);
    start(affected, &moving);
    const double given = energy(values);
    double low = 6;
    for (int i = 0; i < 3000; i++) {
        go(NAN, 0, STEP);
        low = fmin(low, plant.vehicle.state.wheel_speed[0]);
        TEST_ASSERT_DOUBLE_WITHIN(2e-3 * given, given, energy(values));
    }
    TEST_ASSERT_TRUE(low < 5.5);
}

/* Near a rest position the wheel swings like a pendulum, at sqrt(torque order / inertia). */
static void test_it_swings_about_a_detent_and_stays_in_it(void)
{
    const double values[] = {0.02, 6, 0, 0};
    const bp_state moving = {.wheel_speed = {0.2}};
    make_free_motor(values);
    start(affected, &moving);
    const double rate = sqrt(values[0] * values[1] / INERTIA);
    const int steps = (int)(10 * TURN / rate / STEP + 0.5);
    for (int i = 0; i < steps; i++) {
        go(NAN, 0, STEP);
        TEST_ASSERT_TRUE(fabs(plant.vehicle.state.wheel_angle[0]) < 1.01 * 0.2 / rate);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * 0.2 / rate, 0, plant.vehicle.state.wheel_angle[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.2, plant.vehicle.state.wheel_speed[0]);
}

static void test_a_detent_holds_what_is_less_than_its_torque(void)
{
    const double values[] = {0.02, 6, 0, 0};
    use("cogging", values);
    start(affected, NULL);
    const double holds = 0.02 * 22 / 0.195;
    go(0.5 * holds, 0.5 * holds, 20);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, asin(0.5) / 6, plant.vehicle.state.wheel_angle[0]);
    go(1.1 * holds, 1.1 * holds, 3);
    TEST_ASSERT_TRUE(plant.vehicle.state.wheel_angle[0] > TURN / 6);
}

static void test_no_torque_changes_nothing(void)
{
    const double none[] = {0, 6, 1, 1};
    use("cogging", none);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    const double values[] = {0.03, 4, 0, 0.7}, mirrored[] = {0.03, 4, 0, -0.7};
    use("cogging", values);
    assert_mirror("cogging", mirrored);
    const double centred[] = {0.03, 4, 0, 0};
    use("cogging", centred);
    assert_reversal();
    make_motor("cogging", centred);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_floating_motor_keeps_its_energy);
    RUN_TEST(test_it_swings_about_a_detent_and_stays_in_it);
    RUN_TEST(test_a_detent_holds_what_is_less_than_its_torque);
    RUN_TEST(test_no_torque_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
