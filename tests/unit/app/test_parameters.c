#include <string.h>

#include "app/parameters.h"
#include "app/params_gen.h"
#include "app/settings_gen.h"
#include "unity.h"
#include "wire/codecs_gen.h"

#define NUMBER(name) WIRE_PARAMETER_REQUEST_PARAMETER_##name##_CHOICE

enum { FIRST_OF_ROBOT = NUMBER(LEFT_GAIN), END_OF_ROBOT = NUMBER(COUNT_MISMATCH) + 1 };

static parameters_t parameters;

void setUp(void)
{
    memset(&parameters, 0, sizeof parameters);
    parameters_start(&parameters, &PARAMS_COUPLED);
}
void tearDown(void) {}

static void write(uint8_t number, int32_t value)
{
    TEST_ASSERT_EQUAL_INT(PARAMETERS_OK, parameters_write(&parameters, number, value, false));
    TEST_ASSERT_EQUAL_INT32(value, parameters_read(&parameters, number));
}

static void test_parameters_begin_with_the_constants_of_the_profile(void)
{
    TEST_ASSERT_EQUAL_MEMORY(&PARAMS_COUPLED, &parameters.config, sizeof parameters.config);
    TEST_ASSERT_EQUAL_INT32(PARAMS_COUPLED.step.speed_pid.kp_mv_q10, parameters_read(&parameters, NUMBER(SPEED_KP)));
    TEST_ASSERT_EQUAL_INT32(PARAMS_COUPLED.step.mode.los.leg_timeout_ms,
                            parameters_read(&parameters, NUMBER(LEG_TIMEOUT)));
}

static void test_parameters_of_no_compensation_leave_every_constant(void)
{
    for (uint8_t number = FIRST_OF_ROBOT; number < END_OF_ROBOT; number++)
        write(number, 0);
    TEST_ASSERT_EQUAL_MEMORY(&PARAMS_COUPLED, &parameters.config, sizeof parameters.config);
}

static void assert_side(int first, const drive_side_t *found)
{
    TEST_ASSERT_EQUAL_INT16(first, found->gain_q15);
    TEST_ASSERT_EQUAL_INT16(first + 1, found->emf_mv_q15);
    TEST_ASSERT_EQUAL_INT16(first + 2, found->friction_mv);
    TEST_ASSERT_EQUAL_INT16(first + 3, found->offset_mv);
}

static void test_parameters_of_a_robot_reach_every_stage(void)
{
    for (uint8_t i = 0; i < 4; i++) {
        write((uint8_t)(NUMBER(LEFT_GAIN) + i), 10 + i);
        write((uint8_t)(NUMBER(RIGHT_GAIN) + i), 20 + i);
    }
    write(NUMBER(DEADBAND), 30);
    write(NUMBER(HALF_TRACK), 31);
    write(NUMBER(RESERVE), 32);
    write(NUMBER(BATTERY_SAGS), 1);
    write(NUMBER(GYRO_BIAS), -40);
    write(NUMBER(GYRO_SCALE), 41);
    write(NUMBER(COUNT_MISMATCH), -42);
    assert_side(10, &parameters.config.step.mixer.drive.left);
    assert_side(20, &parameters.config.step.mixer.drive.right);
    TEST_ASSERT_EQUAL_INT16(30, parameters.config.step.mixer.drive.deadband_mv);
    TEST_ASSERT_EQUAL_INT16(31, parameters.config.step.mixer.drive.half_track_m_q14);
    TEST_ASSERT_EQUAL_INT16(32, parameters.config.step.mixer.drive.reserve_mv);
    TEST_ASSERT_TRUE(parameters.config.step.mixer.battery_sags);
    TEST_ASSERT_EQUAL_INT16(-40, parameters.config.step.heading.gyro_bias_mrad_s);
    TEST_ASSERT_EQUAL_INT16(41, parameters.config.step.heading.gyro_scale_q15);
    TEST_ASSERT_EQUAL_INT16(-42, parameters.config.step.speed.count_mismatch_q15);
}

static void test_parameters_scale_the_travel_of_a_count(void)
{
    const double believed = PARAMS_COUPLED.step.speed.count_travel_um_q2;

    for (int round = 0; round < 2; round++) { /* written again it does not add up */
        write(NUMBER(TRAVEL_SCALE), -2979);   /* 1 / 1.1 */
        TEST_ASSERT_UINT16_WITHIN(1, believed / 1.1, parameters.config.step.speed.count_travel_um_q2);
    }
    write(NUMBER(TRAVEL_SCALE), 0);
    TEST_ASSERT_EQUAL_UINT16(believed, parameters.config.step.speed.count_travel_um_q2);
}

static void test_parameters_saturate_the_travel_of_a_count(void)
{
    parameters.believed_travel_um_q2 = 40000;
    write(NUMBER(TRAVEL_SCALE), 32767);
    TEST_ASSERT_EQUAL_UINT16(65535, parameters.config.step.speed.count_travel_um_q2);
}

static void refused(parameters_status_t status, uint8_t number, int32_t value, bool running)
{
    const parameters_t before = parameters;

    TEST_ASSERT_EQUAL_INT(status, parameters_write(&parameters, number, value, running));
    TEST_ASSERT_EQUAL_MEMORY(&before, &parameters, sizeof parameters);
}

static void test_parameters_refuse_what_is_outside_their_range(void)
{
    refused(PARAMETERS_RANGE, NUMBER(SPEED_KP), 32768, false);
    refused(PARAMETERS_RANGE, NUMBER(SPEED_KP), -1, false);
    refused(PARAMETERS_RANGE, NUMBER(CRUISE), 0, false);
    refused(PARAMETERS_RANGE, NUMBER(SILENT_TIME), 19, false);
    refused(PARAMETERS_RANGE, NUMBER(SILENT_TIME), 10001, false);
    refused(PARAMETERS_RANGE, NUMBER(LEG_TIMEOUT), 0, false);
    refused(PARAMETERS_RANGE, NUMBER(LEFT_OFFSET), -32001, false);
    refused(PARAMETERS_RANGE, NUMBER(GYRO_BIAS), -32768, false);
    write(NUMBER(LEG_TIMEOUT), 2147483647L);
    write(NUMBER(REST_TIME), 65535);
    write(NUMBER(LEFT_OFFSET), -32000);
    write(NUMBER(MAX_OVERSHOOTS), 255);
}

static void test_parameters_refuse_what_there_is_not(void)
{
    refused(PARAMETERS_UNKNOWN, SETTINGS_COUNT, 0, false);
    refused(PARAMETERS_UNKNOWN, 255, 0, false);
    TEST_ASSERT_EQUAL_INT32(0, parameters_read(&parameters, SETTINGS_COUNT));
}

static void test_parameters_of_the_robot_stay_while_it_drives(void)
{
    for (uint8_t number = FIRST_OF_ROBOT; number < END_OF_ROBOT; number++)
        refused(PARAMETERS_BUSY, number, 1, true);
    for (uint8_t number = 0; number < FIRST_OF_ROBOT; number++) {
        const int32_t value = parameters_read(&parameters, number);
        TEST_ASSERT_EQUAL_INT(PARAMETERS_OK, parameters_write(&parameters, number, value, true));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parameters_begin_with_the_constants_of_the_profile);
    RUN_TEST(test_parameters_of_no_compensation_leave_every_constant);
    RUN_TEST(test_parameters_of_a_robot_reach_every_stage);
    RUN_TEST(test_parameters_scale_the_travel_of_a_count);
    RUN_TEST(test_parameters_saturate_the_travel_of_a_count);
    RUN_TEST(test_parameters_refuse_what_is_outside_their_range);
    RUN_TEST(test_parameters_refuse_what_there_is_not);
    RUN_TEST(test_parameters_of_the_robot_stay_while_it_drives);
    return UNITY_END();
}
