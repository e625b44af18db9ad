/* The friction that the firmware learns, against a robot in double precision that drives along a line: from rest, at 0.5 m/s,
 * and to rest again. The accelerometer has noise and a converter as in sim_host/models/rcx.toml, and a bias of which a part was
 * not learnt. The robot is eq. 12 and 14 without inductance, with dry friction, and shares no code with the firmware.
 */
#include <math.h>

#include "app/params_gen.h"
#include "app/step.h"
#include "models/rcx_gen.h"
#include "sensors/random.h"
#include "unity.h"

enum { LEGS = 6, REST_STEPS = 400, DRIVE_STEPS = 2000, STOP_STEPS = 300 };

static const double STEP_S = STEP_MS / 1e3;

typedef struct {
    double friction_v; /* of each motor */
    double bias;       /* m/s^2, which comes after the rest */
    bool learns;
} robot_t;

typedef struct {
    double speed_error;     /* m/s: the largest, believed less true, 1 s after a start and later */
    double travel_error;    /* m: of the leg that is furthest off */
    double friction_v;      /* in force at the end */
    double most_friction_v; /* that ever was */
} result_t;

static speed_config_t config;
static body_state_t model;
static speed_state_t speed;
static signals_estimate_t estimate;
static random_t noise;
static double true_speed, true_accel, travel, believed;

void setUp(void) {}
void tearDown(void) {}

/* Acceleration by both motors with `volts`, before dry friction. */
static double push(double volts)
{
    const double inertia = RCX_WHEEL_INERTIA + RCX_MASS * RCX_WHEEL_RADIUS * RCX_WHEEL_RADIUS / 2;
    const double loss =
        RCX_VISCOUS_FRICTION + RCX_MASS * RCX_GRAVITY * RCX_ROLLING_FRICTION * RCX_WHEEL_RADIUS * RCX_WHEEL_RADIUS;
    const double wheel = true_speed / RCX_WHEEL_RADIUS;
    const double torque = RCX_TORQUE_CONSTANT / RCX_RESISTANCE * (volts - RCX_EMF_CONSTANT * wheel) - loss * wheel;
    return RCX_WHEEL_RADIUS * torque / inertia;
}

static void move(double volts, double friction_v)
{
    const double inertia = RCX_WHEEL_INERTIA + RCX_MASS * RCX_WHEEL_RADIUS * RCX_WHEEL_RADIUS / 2;
    const double held = RCX_WHEEL_RADIUS * RCX_TORQUE_CONSTANT * friction_v / (RCX_RESISTANCE * inertia);
    const double before = true_speed, free = before + push(volts) * STEP_S;
    true_speed = free > held * STEP_S ? free - held * STEP_S : free < -held * STEP_S ? free + held * STEP_S : 0;
    true_accel = (true_speed - before) / STEP_S;
    travel += (before + true_speed) / 2 * STEP_S;
}

static int16_t accelerometer(double bias)
{
    const double resolution = 2 * RCX_IMU_ACCEL_RANGE / (1 << RCX_IMU_BITS);
    const double felt = true_accel + RCX_IMU_ACCEL_BIAS_SURGE + bias + RCX_IMU_ACCEL_NOISE_SD * random_normal(&noise);
    return (int16_t)lround(1e3 * resolution * round(felt / resolution));
}

/* One step of model and estimator. `volts` is what the motors had. */
static void observe(double volts, double bias, bool at_rest)
{
    const int16_t mv = (int16_t)lround(1e3 * volts);
    const int16_t taken_mv = friction_takes_mv(&config.friction, &speed.friction, speed.speed_mm_s_q4, mv);
    const signals_sensors_t sensors = {
        .have = SENSOR_GYRO | SENSOR_ACCELEROMETER, .period_ms = STEP_MS, .accel_surge_mm_s2 = accelerometer(bias)};
    signals_predicted_t predicted = {.driven = mv != 0};

    body_predict(&MODEL_COUPLED, &model, (int16_t)(mv - taken_mv), (int16_t)(mv - taken_mv));
    predicted.motion = model.motion;
    estimate.at_rest = at_rest;
    estimate.period_ms = STEP_MS;
    body_correct_surge(&MODEL_COUPLED, &model, speed_step(&config, &speed, &sensors, &predicted, &estimate));
    believed += estimate.travel_um_q5 / 32e6;
}

/* The speed controller without its integral, with feedforward. */
static double control(double demanded)
{
    const double friction = demanded > 0 ? friction_mv(&config.friction, &speed.friction) / 1e3 : 0;
    const double volts = 6.67 * demanded + friction + 20 * (demanded - estimate.speed_mm_s_q4 / 16e3);
    return fmax(-9, fmin(9, volts));
}

static void leg(const robot_t *robot, result_t *result)
{
    double volts = 0;
    travel = believed = 0;
    for (int i = 0; i < DRIVE_STEPS + STOP_STEPS; i++) {
        const double demanded = i < DRIVE_STEPS ? 0.5 : 0;
        move(volts, robot->friction_v);
        observe(volts, robot->bias, false);
        volts = control(demanded);
        if (i > 333 && i < DRIVE_STEPS)
            result->speed_error = fmax(result->speed_error, fabs(estimate.speed_mm_s_q4 / 16e3 - true_speed));
        result->most_friction_v = fmax(result->most_friction_v, friction_mv(&config.friction, &speed.friction) / 1e3);
    }
    result->travel_error = fmax(result->travel_error, fabs(believed - travel));
}

static result_t drive(const robot_t robot, uint64_t seed)
{
    result_t result = {0};
    config = PARAMS_COUPLED.step.speed;
    if (!robot.learns)
        config.friction.mv_per_mm_s2_q10 = 0;
    model = (body_state_t){.motion = {0}};
    speed = (speed_state_t){.speed_mm_s_q17 = 0};
    estimate = (signals_estimate_t){.period_ms = STEP_MS};
    random_start(&noise, seed);
    true_speed = true_accel = 0;
    for (int i = 0; i < REST_STEPS; i++)
        observe(0, 0, true);
    for (int i = 0; i < LEGS; i++)
        leg(&robot, &result);
    result.friction_v = friction_mv(&config.friction, &speed.friction) / 1e3;
    return result;
}

/* What is found has a standard deviation of 16 mV, by the accelerometer's noise and the error of its bias. */
static void test_friction_is_found_and_told_apart_from_speed(void)
{
    static const double FRICTIONS_V[] = {0.4, 0.564, 0.9, 1.35, 2.2, 2.9};
    for (int i = 0; i < 6; i++)
        for (uint64_t seed = 0; seed < 10; seed++) {
            const result_t learnt = drive((robot_t){FRICTIONS_V[i], 0, true}, seed);
            const result_t without = drive((robot_t){FRICTIONS_V[i], 0, false}, seed);
            TEST_ASSERT_DOUBLE_WITHIN(0.06, FRICTIONS_V[i], learnt.friction_v);
            TEST_ASSERT_LESS_THAN_DOUBLE(0.012, learnt.speed_error);
            TEST_ASSERT_LESS_THAN_DOUBLE(without.travel_error / 5, learnt.travel_error);
        }
}

static void test_a_robot_without_friction_learns_none(void)
{
    for (uint64_t seed = 0; seed < 20; seed++) {
        const result_t learnt = drive((robot_t){0, 0, true}, seed);
        TEST_ASSERT_EQUAL_DOUBLE(0, learnt.most_friction_v);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.012, learnt.travel_error); /* of 3 m */
    }
}

/* The packaged accelerometer's whole bias comes after the rest. One of its signs feigns no friction at all. The other feigns one
 * that is mostly below what comes into force. */
static void test_a_bias_that_was_not_learnt_hardly_feigns_a_friction(void)
{
    double mean_v = 0;
    for (uint64_t seed = 0; seed < 20; seed++) {
        const result_t more = drive((robot_t){0, RCX_IMU_ACCEL_BIAS_SURGE, true}, seed);
        const result_t less = drive((robot_t){0, -RCX_IMU_ACCEL_BIAS_SURGE, true}, seed);
        TEST_ASSERT_EQUAL_DOUBLE(0, more.most_friction_v);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.008, more.speed_error);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.2, less.most_friction_v);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.025, less.speed_error);
        mean_v += less.friction_v / 20;
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(0.03, mean_v);
}

static void test_friction_with_such_a_bias_is_still_told_better_than_without(void)
{
    for (int i = -1; i <= 1; i += 2)
        for (uint64_t seed = 0; seed < 20; seed++) {
            const double bias = i * RCX_IMU_ACCEL_BIAS_SURGE;
            const result_t learnt = drive((robot_t){0.564, bias, true}, seed);
            const result_t without = drive((robot_t){0.564, bias, false}, seed);
            TEST_ASSERT_LESS_THAN_DOUBLE(without.travel_error / 2, learnt.travel_error);
        }
}

/* With a hundred times that bias the friction keeps its limit, and does not move a model whose motors are off. */
static void test_no_bias_runs_away(void)
{
    for (int i = -1; i <= 1; i += 2) {
        const result_t learnt = drive((robot_t){0.564, i * 3.0, true}, 1);
        TEST_ASSERT_LESS_OR_EQUAL_DOUBLE(FRICTION_MOST_MV / 1e3, learnt.most_friction_v);
        true_accel = 0;
        for (int k = 0; k < 1000; k++)
            observe(0, 0, false);
        TEST_ASSERT_LESS_THAN_DOUBLE(0.01, fabs(estimate.speed_mm_s_q4 / 16e3));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_friction_is_found_and_told_apart_from_speed);
    RUN_TEST(test_a_robot_without_friction_learns_none);
    RUN_TEST(test_a_bias_that_was_not_learnt_hardly_feigns_a_friction);
    RUN_TEST(test_friction_with_such_a_bias_is_still_told_better_than_without);
    RUN_TEST(test_no_bias_runs_away);
    return UNITY_END();
}
