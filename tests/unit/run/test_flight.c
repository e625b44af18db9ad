#include <math.h>
#include <string.h>

#include "brickpilot_sim.h"
#include "run/flight_log.h"
#include "unity.h"
#include "wire/codecs_gen.h"

enum { STEPS = 2000 };

static const double CORNER[] = {0.3, 0, 0.3, 0.3};
static bp_model *model;
static bp_flight flight;
static short motors[2 * STEPS], again[2 * STEPS];

void setUp(void)
{
    model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    flight = (bp_flight){.model = model,
                         .controller = BP_COUPLED,
                         .sensors = BP_SENSORS_IMU_ENCODERS,
                         .steps = STEPS,
                         .start_step = 300,
                         .waypoint_count = 2,
                         .waypoints = CORNER,
                         .motors = motors};
}
void tearDown(void)
{
    bp_model_free(model);
}

static void test_flight_keeps_still_until_its_start_step_and_drives_then(void)
{
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    TEST_ASSERT_EACH_EQUAL_INT16(0, motors, 2 * 300);
    TEST_ASSERT_GREATER_THAN_INT16(1000, motors[2 * 320]);
}

static void test_flight_of_another_seed_differs_and_of_the_same_does_not(void)
{
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    flight.motors = again;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    TEST_ASSERT_EQUAL_MEMORY(motors, again, sizeof motors);
    flight.seed = 1;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    TEST_ASSERT_NOT_EQUAL(0, memcmp(motors, again, sizeof motors));
}

static void test_flight_refuses_what_it_cannot_fly(void)
{
    static const double TWICE[] = {1, 0, 1, 0};
    static const double FAR[] = {31, 0};
    bp_flight bad = flight;
    bad.steps = 0;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.waypoint_count = BP_MAX_WAYPOINTS + 1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.waypoints = TWICE;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.waypoints = FAR;
    bad.waypoint_count = 1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.sensors = 9;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.controller = 2;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.cruise = NAN;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.start_step = -1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    for (int column = -1; column <= FLIGHT_LOG_COLUMNS; column += FLIGHT_LOG_COLUMNS + 1) {
        bad = flight;
        bad.columns = &column;
        bad.column_count = 1;
        TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    }
    bad = flight;
    bad.waypoints = NULL;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    static const double STILL[2 * STEPS];
    bad = flight;
    bad.drive = STILL; /* a schedule has no waypoints, so their count has to be 0 */
    bad.waypoint_count = BP_MAX_WAYPOINTS + 1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    static const double NOWHERE[] = {NAN, 0};
    bad = flight;
    bad.waypoints = NOWHERE;
    bad.waypoint_count = 1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    static const bp_setting OUTSIDE[] = {{WIRE_PARAMETER_REQUEST_PARAMETER_LEFT_FRICTION_CHOICE, -1},
                                         {WIRE_PARAMETER_REQUEST_PARAMETER_DEADBAND_CHOICE, 32001},
                                         {WIRE_PARAMETER_REQUEST_PARAMETER_RIGHT_OFFSET_CHOICE, -32001},
                                         {WIRE_PARAMETER_REQUEST_PARAMETER_HALF_TRACK_CHOICE, -1},
                                         {WIRE_PARAMETER_REQUEST_PARAMETER_BATTERY_SAGS_CHOICE, 2},
                                         {64, 0},
                                         {256, 0},
                                         {-1, 0}};
    for (size_t i = 0; i < sizeof OUTSIDE / sizeof *OUTSIDE; i++) {
        bad = flight;
        bad.settings = &OUTSIDE[i];
        bad.setting_count = 1;
        TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    }
    bad = flight;
    bad.setting_count = 1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad.setting_count = -1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bad = flight;
    bad.model = NULL;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bp_model *motor = bp_model_new(BP_MOTOR, BP_COUPLED);
    bad = flight;
    bad.model = motor;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&bad));
    bp_model_free(motor);
}

static void test_flight_with_a_compensation_of_zero_is_the_same_byte_for_byte(void)
{
    bp_setting nothing[16];
    for (int i = 0; i < 16; i++)
        nothing[i] = (bp_setting){(int)WIRE_PARAMETER_REQUEST_PARAMETER_LEFT_GAIN_CHOICE + i, 0};
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    flight.motors = again;
    flight.settings = nothing;
    flight.setting_count = 16;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    TEST_ASSERT_EQUAL_MEMORY(motors, again, sizeof motors);
}

static void test_flight_that_compensates_a_dead_band_drives_as_the_robot_without_one(void)
{
    static const bp_setting DEADBAND = {WIRE_PARAMETER_REQUEST_PARAMETER_DEADBAND_CHOICE, 500};
    const double deadband[] = {0.5, 0};
    flight.sensors = BP_SENSORS_IDEAL;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    bp_model_add_effect(model, "actuator_deadband", deadband);
    flight.motors = again;
    flight.settings = &DEADBAND;
    flight.setting_count = 1;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    const int16_t lost_q15 = 1821; /* 0.5 V of 9 V, whose reading is rounded down */
    TEST_ASSERT_INT16_WITHIN(lost_q15 / 20, motors[2 * 400] + lost_q15, again[2 * 400]);
}

static void test_flight_with_half_the_cruise_drives_the_motors_less(void)
{
    flight.cruise = 0.3;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    flight.motors = again;
    flight.cruise = 0.15;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    TEST_ASSERT_LESS_THAN_INT16(motors[2 * 400], again[2 * 400]);
}

static void test_flight_of_a_schedule_shorts_the_motors_when_its_path_is_done(void)
{
    static double drive[2 * STEPS];
    for (int i = 0; i < 2 * STEPS; i++)
        drive[i] = 4.5;
    flight.waypoint_count = 0;
    flight.drive = drive;
    flight.stop_path = 0.5;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    TEST_ASSERT_EQUAL_INT16(16384, motors[0]);
    TEST_ASSERT_EQUAL_INT16(0, motors[2 * STEPS - 1]);
}

static void test_flight_goes_on_with_the_later_model_from_its_step_on(void)
{
    const double torque = 0.01;
    bp_model *later = bp_model_copy(model);
    bp_flight both[2];
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    flight.motors = again;
    flight.later = later;
    flight.later_step = 900;
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight)); /* the same model: only the change itself could show */
    TEST_ASSERT_EQUAL_MEMORY(motors, again, sizeof motors);
    bp_model_add_effect(later, "coulomb_friction", &torque);
    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    TEST_ASSERT_EQUAL_MEMORY(motors, again, 2 * 901 * sizeof *motors);
    TEST_ASSERT_NOT_EQUAL(0, memcmp(motors + 2 * 901, again + 2 * 901, 2 * 20 * sizeof *motors));

    both[0] = both[1] = flight; /* side by side the flights change their models, too */
    both[0].later = NULL;
    both[0].motors = NULL;
    both[1].motors = motors;
    TEST_ASSERT_EQUAL_INT(0, bp_fly_many(both, 2, 8));
    TEST_ASSERT_EQUAL_MEMORY(again, motors, sizeof motors);
    bp_model_free(later);
}

static void test_flight_refuses_a_later_model_of_another_vehicle(void)
{
    bp_model *later = bp_model_new(BP_SKID_STEER, BP_COUPLED);
    flight.later = later;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&flight));
    bp_model_free(later);
    flight.later = later = bp_model_new(BP_DIFF_DRIVE, BP_PAPER);
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&flight));
    flight.later = model;
    flight.later_step = -1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_fly(&flight));
    bp_model_free(later);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_flight_keeps_still_until_its_start_step_and_drives_then);
    RUN_TEST(test_flight_of_another_seed_differs_and_of_the_same_does_not);
    RUN_TEST(test_flight_refuses_what_it_cannot_fly);
    RUN_TEST(test_flight_with_a_compensation_of_zero_is_the_same_byte_for_byte);
    RUN_TEST(test_flight_that_compensates_a_dead_band_drives_as_the_robot_without_one);
    RUN_TEST(test_flight_with_half_the_cruise_drives_the_motors_less);
    RUN_TEST(test_flight_of_a_schedule_shorts_the_motors_when_its_path_is_done);
    RUN_TEST(test_flight_goes_on_with_the_later_model_from_its_step_on);
    RUN_TEST(test_flight_refuses_a_later_model_of_another_vehicle);
    return UNITY_END();
}
