/* The sites of effect.h. Each has an effect made for this test, and the plant responds to what its hook changes. */
#include <math.h>
#include <string.h>

#include "plant/plant.h"
#include "unity.h"

static const double STEP = 0.003;

static bp_model *model;
static plant_t plant;
static double out[OUTPUT_COUNT];

void setUp(void)
{
    model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
}

static void use(const effect_t *effect, double value)
{
    model->effect[model->effect_count].effect = effect;
    model->effect[model->effect_count++].value[0] = value;
}

static void start(const bp_state *initial)
{
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, initial, 0, 0));
}

static void go(double left, double right, double seconds)
{
    const double input[2] = {left, right};
    for (int i = 0; i < (int)(seconds / STEP + 0.5); i++)
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, STEP));
    plant_outputs(&plant, out);
}

/* Multiplies the mass by its value; the yaw inertia stays. */
static void heavy(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->build.mass *= value[0];
}
static const effect_t HEAVY = {.info = {.name = "heavy"}, .hook = {[SITE_BUILD] = heavy}};

static void test_build_hook_changes_the_vehicle_before_it_starts(void)
{
    start(NULL);
    go(6, 6, 0.3);
    const double reached = out[OUTPUT_SURGE];
    bp_model_set(model, "mass", 0.45);
    use(&HEAVY, 2);
    for (int run = 0; run < 2; run++) {
        start(NULL);
        go(6, 6, 0.3);
        TEST_ASSERT_EQUAL_DOUBLE(reached, out[OUTPUT_SURGE]);
    }
}

/* Holds back the commands until `value` seconds after the run's start; its memory counts the time. */
static void late(const double *value, double *memory, vehicle_t *vehicle)
{
    if (memory[0] < value[0] - 1e-9)
        vehicle->command[0] = vehicle->command[1] = 0;
    memory[0] += vehicle->step;
}
static const effect_t LATE = {.info = {.name = "late"}, .memory_count = 1, .hook = {[SITE_TIMING] = late}};

static void test_timing_hook_acts_between_body_steps_and_keeps_its_memory(void)
{
    start(NULL);
    go(6, 6, 0.3);
    const double reached = out[OUTPUT_SURGE];
    use(&LATE, 0.0615);
    start(NULL);
    go(6, 6, 0.06);
    TEST_ASSERT_TRUE(out[OUTPUT_SURGE] == 0);
    const double input[2] = {6, 6};
    plant_advance(&plant, input, 0.0015);
    plant_advance(&plant, input, 0.3);
    plant_outputs(&plant, out);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, reached, out[OUTPUT_SURGE]);
}

static void test_memory_is_empty_at_the_start_of_every_run(void)
{
    use(&LATE, 0.06);
    for (int run = 0; run < 2; run++) {
        start(NULL);
        go(6, 6, 0.06);
        TEST_ASSERT_TRUE(out[OUTPUT_SURGE] == 0);
        go(6, 6, 0.03);
        TEST_ASSERT_TRUE(out[OUTPUT_SURGE] > 0.01);
    }
}

static void sag(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->supply -= value[0] * vehicle->supply_current;
}
static const effect_t SAG = {.info = {.name = "sag"}, .hook = {[SITE_SUPPLY] = sag}};

static void test_supply_hook_lowers_voltage_by_what_the_motors_draw(void)
{
    const double stiff = 1e4;
    use(&SAG, 2);
    bp_model_set(model, "wheel_inertia", stiff); /* stalled */
    start(NULL);
    go(9, 9, 1);
    const double current = 9.0 / (22 + 2 * 2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, current, out[OUTPUT_CURRENT_LEFT]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 9 - 2 * 2 * current, out[OUTPUT_BATTERY_VOLTAGE]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 2 * current, plant.vehicle.supply_current);
}

static void test_supply_current_counts_the_share_of_the_battery_the_drive_uses(void)
{
    bp_model_set(model, "wheel_inertia", 1e4);
    start(NULL);
    go(4.5, -4.5, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 2 * 0.5 * 4.5 / 22, plant.vehicle.supply_current);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 4.5 / 22, plant.vehicle.state.charge);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.999, plant.vehicle.state.age);
}

static void weak_left(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->motor[0].torque_constant *= value[0];
}
static const effect_t WEAK_LEFT = {.info = {.name = "weak_left"}, .hook = {[SITE_MOTOR] = weak_left}};

static void test_motor_hook_changes_one_motor_from_its_nominal_value(void)
{
    use(&WEAK_LEFT, 0.5);
    start(NULL);
    go(6, 6, 1);
    TEST_ASSERT_EQUAL_DOUBLE(0.195, plant.vehicle.motor[1].torque_constant);
    TEST_ASSERT_EQUAL_DOUBLE(0.0975, plant.vehicle.motor[0].torque_constant);
    TEST_ASSERT_TRUE(out[OUTPUT_YAW_RATE] < -0.1);
}

static void push(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->wheel_torque[0] += value[0];
    vehicle->wheel_torque[1] += value[0];
}
static const effect_t PUSH = {.info = {.name = "push"}, .hook = {[SITE_WHEEL] = push}};

static void slope(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->force_surge += value[0] * cos(vehicle->middle.heading);
}
static const effect_t SLOPE = {.info = {.name = "slope"}, .hook = {[SITE_BODY] = slope}};

static void test_a_force_on_the_body_is_half_its_torque_on_each_wheel(void)
{
    use(&PUSH, 0.0408 * 0.5);
    start(NULL);
    go(NAN, NAN, 0.5);
    const double pushed = out[OUTPUT_SURGE];
    model->effect_count = 0;
    use(&SLOPE, 1);
    start(NULL);
    go(NAN, NAN, 0.5);
    TEST_ASSERT_TRUE(pushed > 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, pushed, out[OUTPUT_SURGE]);
}

static void test_a_force_in_the_earth_frame_turns_with_the_heading(void)
{
    use(&SLOPE, 1);
    const bp_state turned = {.heading = 3.141592653589793};
    start(&turned);
    go(NAN, NAN, 0.5);
    TEST_ASSERT_TRUE(out[OUTPUT_SURGE] < -0.3);
    TEST_ASSERT_TRUE(out[OUTPUT_X] > 0);
}

static void scrub(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    vehicle->dry[DRY_YAW] += value[0];
}
static const effect_t SCRUB = {.info = {.name = "scrub"}, .hook = {[SITE_WHEEL] = scrub}};

/* A moment N on the body is N r_w / (2 b) at the wheels; two such effects hold twice as much. */
static void test_dry_bounds_of_two_effects_add_up(void)
{
    const double moment = 2 * 0.07 / 0.0408 * 0.195 * 2 / 22; /* of +-2 V at stall */
    use(&SCRUB, 0.96 * moment);
    start(NULL);
    go(2, -2, 1);
    TEST_ASSERT_TRUE(out[OUTPUT_YAW_RATE] > 0.01);
    use(&SCRUB, 0.05 * moment);
    start(NULL);
    go(2, -2, 1);
    TEST_ASSERT_TRUE(out[OUTPUT_YAW_RATE] == 0);
    go(2, 2, 1);
    TEST_ASSERT_TRUE(out[OUTPUT_SURGE] > 0.1 && out[OUTPUT_YAW_RATE] == 0);
}

static void bias(const double *value, double *memory, vehicle_t *vehicle)
{
    memory[0] += vehicle->step;
    vehicle->output[OUTPUT_YAW_RATE] += value[0] + memory[0];
}
static const effect_t BIAS = {.info = {.name = "bias"}, .memory_count = 1, .hook = {[SITE_SENSOR] = bias}};

static void test_sensor_hook_changes_what_is_seen_and_not_what_is(void)
{
    use(&BIAS, 0.25);
    start(NULL);
    plant_outputs(&plant, out);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, out[OUTPUT_YAW_RATE]);
    go(5, 5, 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.25 + 0.3, out[OUTPUT_YAW_RATE]);
    TEST_ASSERT_TRUE(plant.vehicle.state.yaw_rate == 0);
    TEST_ASSERT_TRUE(out[OUTPUT_SURGE] == plant.vehicle.state.surge);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_build_hook_changes_the_vehicle_before_it_starts);
    RUN_TEST(test_timing_hook_acts_between_body_steps_and_keeps_its_memory);
    RUN_TEST(test_memory_is_empty_at_the_start_of_every_run);
    RUN_TEST(test_supply_hook_lowers_voltage_by_what_the_motors_draw);
    RUN_TEST(test_supply_current_counts_the_share_of_the_battery_the_drive_uses);
    RUN_TEST(test_motor_hook_changes_one_motor_from_its_nominal_value);
    RUN_TEST(test_a_force_on_the_body_is_half_its_torque_on_each_wheel);
    RUN_TEST(test_a_force_in_the_earth_frame_turns_with_the_heading);
    RUN_TEST(test_dry_bounds_of_two_effects_add_up);
    RUN_TEST(test_sensor_hook_changes_what_is_seen_and_not_what_is);
    return UNITY_END();
}
