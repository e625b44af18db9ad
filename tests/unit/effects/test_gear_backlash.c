#include "affected.h"

static const double VALUES[] = {0.3, 0.6};
static const double ROTOR = 0.6 * 1e-4;
static const double INERTIA = 1e-4 + 0.45 * 0.04 * 0.04;
static const double TORQUE = 0.195 * 4 / 22;

/* Without back EMF and inductance the torque is constant: the rotor crosses half the gap in sqrt(gap ROTOR /
 * TORQUE). */
static void make_ideal(void)
{
    make_motor("gear_backlash", VALUES);
    set("emf_constant", 0);
    set("inductance", 0);
    set("viscous_friction", 0);
    set("drag_area", 0);
}

static double crossing(double angle)
{
    return sqrt(2 * angle * ROTOR / TORQUE);
}

static void test_the_wheel_waits_until_the_rotor_has_crossed_the_gap(void)
{
    make_ideal();
    start(affected, NULL);
    const double arrives = crossing(0.5 * VALUES[0]);
    const double input[2] = {4, 0};
    plant_advance(&plant, input, arrives - 0.0006);
    const double impact = TORQUE * arrives / INERTIA;
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * impact, 0, plant.vehicle.state.wheel_speed[0]); /* a motor step's share */
    plant_advance(&plant, input, 0.0012);
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * impact, impact, plant.vehicle.state.wheel_speed[0]);
}

static void test_no_momentum_is_lost_in_the_gap_or_the_impact(void)
{
    make_ideal();
    start(affected, NULL);
    go(4, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, TORQUE * 0.3 / INERTIA, plant.vehicle.state.wheel_speed[0]);
}

/* While the rotor turns back across the whole gap, the wheel coasts. */
static void test_a_reversal_is_felt_late(void)
{
    make_ideal();
    start(affected, NULL);
    go(4, 0, 0.3);
    const double speed = plant.vehicle.state.wheel_speed[0];
    const double input[2] = {-4, 0}, arrives = crossing(VALUES[0]);
    plant_advance(&plant, input, arrives - 0.001);
    TEST_ASSERT_DOUBLE_WITHIN(0.003 * speed, speed, plant.vehicle.state.wheel_speed[0]);
    plant_advance(&plant, input, 0.3 - arrives + 0.001);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 0, plant.vehicle.state.wheel_speed[0]);
}

/* A floating rotor keeps its speed in the play, so the wheel's losses slow down only the other inertias. */
static void test_in_the_gap_the_wheel_slows_without_the_rotor(void)
{
    const double wide[] = {3, 0.6};
    const bp_state moving = {.wheel_speed = {10}};
    make_motor("gear_backlash", wide);
    set("wheel_inertia", 5e-4);
    set("viscous_friction", 0.005);
    set("drag_area", 0);
    start(affected, &moving);
    go(NAN, 0, 0.15);
    const double rest = 0.4 * 5e-4 + 0.45 * 0.04 * 0.04;
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 10 * exp(-0.15 * 0.005 / rest), plant.vehicle.state.wheel_speed[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 10 - plant.vehicle.state.wheel_speed[0], plant.memory[1]);
}

static void test_a_slow_step_does_not_blow_up_a_light_rotor(void)
{
    const double light[] = {3, 0.01};
    use("gear_backlash", light);
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, affected, NULL, STEP, STEP));
    double most = 0;
    for (int i = 0; i < 30; i++) {
        go(6, 6, STEP);
        most = fmax(most, plant.memory[1]);
    }
    TEST_ASSERT_TRUE(most > 0.9 * 6 / 0.245 && most < 2 * 6 / 0.245);
}

/* In slow motion against friction, the wheel's angle over the rotor's angle has two branches, one gap apart. */
static void test_the_rotor_leads_by_half_the_gap_in_either_direction(void)
{
    const double friction = 0.01;
    use("gear_backlash", VALUES);
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(affected, "coulomb_friction", &friction));
    start(affected, NULL);
    const double *play = &plant.memory[0];
    go(2, 2, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.15, *play);
    const double angle = plant.vehicle.state.wheel_angle[0];
    go(0, 0, 0.6);
    const double rest = plant.vehicle.state.wheel_angle[0];
    TEST_ASSERT_TRUE(rest > angle && plant.vehicle.state.wheel_speed[0] == 0);
    go(-0.9, -0.9, 1); /* too weak against the friction: only the rotor moves */
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.15, *play);
    go(-2, -2, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.15, *play);
    TEST_ASSERT_TRUE(plant.vehicle.state.wheel_angle[0] < rest - 1);
}

static double end_angle(double motor_step)
{
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, affected, NULL, motor_step, 0));
    for (int i = 0; i < 10; i++)
        go(i % 2 == 0 ? 6 : -4, i % 3 == 0 ? -5 : 5, 0.3);
    TEST_ASSERT_TRUE(fabs(plant.vehicle.state.wheel_speed[0]) < 30);
    return plant.vehicle.state.wheel_angle[0];
}

static void test_the_motor_step_hardly_matters(void)
{
    use("gear_backlash", VALUES);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, end_angle(0.00003), end_angle(0.0003));
}

static void test_any_share_and_gap_is_stable(void)
{
    const double gaps[] = {1e-4, 0.05, 3}, shares[] = {0.01, 0.5, 0.9};
    for (int i = 0; i < 9; i++) {
        const double values[] = {gaps[i / 3], shares[i % 3]};
        make(BP_DIFF_DRIVE, BP_PAPER);
        use("gear_backlash", values);
        const double wheels_alone = end_angle(0.003);
        make(BP_DIFF_DRIVE, BP_COUPLED);
        use("gear_backlash", values);
        TEST_ASSERT_TRUE(isfinite(wheels_alone) && isfinite(end_angle(0.003)));
        make(BP_MOTOR, BP_COUPLED);
        use("gear_backlash", values);
        end_angle(0.0003);
    }
}

static void test_no_gap_changes_nothing(void)
{
    const double none[] = {0, 0.6};
    use("gear_backlash", none);
    assert_no_effect();
}

static void test_a_drive_that_commands_force_has_play_in_metres(void)
{
    const double values[] = {0.01, 0.2};
    make(BP_MOTOR, BP_COUPLED);
    set("force_per_volt", 35);
    set("mass", 95);
    set("viscous_friction", 0);
    use("gear_backlash", values);
    start(affected, NULL);
    const double arrives = sqrt(0.01 * 0.2 * 95 / 70);
    go(2, 0, arrives - 0.006);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, plant.vehicle.state.wheel_speed[0]);
    go(2, 0, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 70 * plant.vehicle.state.age / 95, plant.vehicle.state.wheel_speed[0]);
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("gear_backlash", VALUES);
    assert_reversal();
    assert_mirror("gear_backlash", VALUES);
    make_motor("gear_backlash", VALUES);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_wheel_waits_until_the_rotor_has_crossed_the_gap);
    RUN_TEST(test_no_momentum_is_lost_in_the_gap_or_the_impact);
    RUN_TEST(test_a_reversal_is_felt_late);
    RUN_TEST(test_in_the_gap_the_wheel_slows_without_the_rotor);
    RUN_TEST(test_a_slow_step_does_not_blow_up_a_light_rotor);
    RUN_TEST(test_the_rotor_leads_by_half_the_gap_in_either_direction);
    RUN_TEST(test_the_motor_step_hardly_matters);
    RUN_TEST(test_any_share_and_gap_is_stable);
    RUN_TEST(test_no_gap_changes_nothing);
    RUN_TEST(test_a_drive_that_commands_force_has_play_in_metres);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
