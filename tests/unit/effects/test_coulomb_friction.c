#include <math.h>

#include "plant/plant.h"
#include "unity.h"

static const double TORQUE = 0.006;
static const double STEP = 0.003;

static bp_model *model;
static plant_t plant;

void setUp(void)
{
    model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    bp_model_add_effect(model, "coulomb_friction", &TORQUE);
    plant_start(&plant, model, NULL, 0, 0);
}
void tearDown(void)
{
    bp_model_free(model);
}

static void go(double left, double right, double seconds)
{
    const double input[2] = {left, right};
    for (int i = 0; i < (int)(seconds / STEP + 0.5); i++)
        plant_advance(&plant, input, STEP);
}

/* K_t V / R = torque at this voltage. */
static double breakaway(void)
{
    return TORQUE * 22 / 0.195;
}

static void test_below_breakaway_nothing_moves_at_all(void)
{
    go(0.999 * breakaway(), 0.999 * breakaway(), 10);
    TEST_ASSERT_TRUE(plant.vehicle.state.wheel_angle[0] == 0 && plant.vehicle.state.x == 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.999 * breakaway() / 22, plant.vehicle.state.current[0]);
    go(-0.999 * breakaway(), 0.999 * breakaway(), 10);
    TEST_ASSERT_TRUE(plant.vehicle.state.heading == 0);
}

static void test_above_breakaway_it_moves(void)
{
    go(1.01 * breakaway(), 1.01 * breakaway(), 1);
    TEST_ASSERT_TRUE(plant.vehicle.state.surge > 1e-4);
}

static void test_one_wheel_can_hold_while_the_other_turns(void)
{
    const double loss = 1.8e-5 + 0.9 * 9.81 * 0.015 * 0.0408 * 0.0408 + 0.195 * 0.245 / 22;
    go(3 * breakaway(), 0, 5);
    TEST_ASSERT_TRUE(plant.vehicle.state.wheel_speed[1] == 0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 2 * TORQUE / loss, plant.vehicle.state.wheel_speed[0]);
}

static void test_steady_speed_loses_the_friction_torque(void)
{
    bp_model_set(model, "drag_area", 0);
    const double loss = 1.8e-5 + 0.9 * 9.81 * 0.015 * 0.0408 * 0.0408 + 0.195 * 0.245 / 22;
    go(9, 9, 20);
    TEST_ASSERT_DOUBLE_WITHIN(1e-8, (0.195 * 9 / 22 - TORQUE) / loss, plant.vehicle.state.wheel_speed[0]);
}

/* Without motor and other losses the speed falls linearly: v^2 / (2 a) of way, then it stands for good. */
static void test_coasting_stops_where_the_friction_says_and_stays(void)
{
    bp_model_set(model, "rolling_friction", 0);
    bp_model_set(model, "viscous_friction", 0);
    bp_model_set(model, "drag_area", 0);
    const bp_state moving = {.surge = 0.5};
    plant_start(&plant, model, &moving, 0, 0);
    const double deceleration = TORQUE / (1e-4 + 0.45 * 0.0408 * 0.0408) * 0.0408;
    go(NAN, NAN, 0.5 * 0.5 / deceleration);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.25, plant.vehicle.state.surge);
    go(NAN, NAN, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.25 / (2 * deceleration), plant.vehicle.state.x);
    TEST_ASSERT_TRUE(plant.vehicle.state.surge == 0);
    const double stopped = plant.vehicle.state.x;
    go(NAN, NAN, 5);
    TEST_ASSERT_TRUE(plant.vehicle.state.x == stopped);
}

static void test_friction_of_a_slow_motor_step_is_the_same(void)
{
    plant_start(&plant, model, NULL, 0.003, 0.003);
    go(0.999 * breakaway(), 0.999 * breakaway(), 3);
    TEST_ASSERT_TRUE(plant.vehicle.state.x == 0);
    go(1.01 * breakaway(), 1.01 * breakaway(), 1);
    TEST_ASSERT_TRUE(plant.vehicle.state.surge > 1e-4);
}

static void test_a_linear_motor_has_its_friction_in_newton(void)
{
    bp_model *axis = bp_model_new(BP_MOTOR, BP_COUPLED);
    const double newton = 20;
    bp_model_set(axis, "force_per_volt", 35);
    bp_model_set(axis, "mass", 95);
    bp_model_set(axis, "viscous_friction", 200);
    bp_model_add_effect(axis, "coulomb_friction", &newton);
    plant_start(&plant, axis, NULL, 0, 0);
    go(19.9 / 35, 0, 1);
    TEST_ASSERT_TRUE(plant.vehicle.state.wheel_angle[0] == 0);
    go(2, 0, 20);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 50.0 / 200, plant.vehicle.state.wheel_speed[0]);
    bp_model_free(axis);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_below_breakaway_nothing_moves_at_all);
    RUN_TEST(test_above_breakaway_it_moves);
    RUN_TEST(test_one_wheel_can_hold_while_the_other_turns);
    RUN_TEST(test_steady_speed_loses_the_friction_torque);
    RUN_TEST(test_coasting_stops_where_the_friction_says_and_stays);
    RUN_TEST(test_friction_of_a_slow_motor_step_is_the_same);
    RUN_TEST(test_a_linear_motor_has_its_friction_in_newton);
    return UNITY_END();
}
