#include "mixer/drive.h"
#include "unity.h"

enum { AHEAD_Q4 = 16 * 300 }; /* 300 mm/s */
static drive_config_t config;

void setUp(void)
{
    config = (drive_config_t){.half_track_m_q14 = 0};
}
void tearDown(void) {}

static int16_t left(int16_t wanted_mv, int16_t speed_mm_s_q4)
{
    return drive_voltage_mv(&config, &config.left, wanted_mv, speed_mm_s_q4);
}

static void test_drive_of_nothing_changes_nothing(void)
{
    for (int32_t wanted = -32767; wanted <= 32767; wanted += 97) {
        TEST_ASSERT_EQUAL_INT16(wanted, left((int16_t)wanted, INT16_MAX));
        TEST_ASSERT_EQUAL_INT16(wanted, left((int16_t)wanted, 0));
    }
}

static void test_drive_turning_is_yaw_rate_times_half_track(void)
{
    TEST_ASSERT_EQUAL_INT16(0, drive_turning_mm_s_q4(&config, 1000));
    config.half_track_m_q14 = 1147; /* 0.07 m */
    TEST_ASSERT_INT16_WITHIN(1, 16 * 70, drive_turning_mm_s_q4(&config, 1000));
    TEST_ASSERT_INT16_WITHIN(1, -16 * 70, drive_turning_mm_s_q4(&config, -1000));
    config.half_track_m_q14 = 32767;
    TEST_ASSERT_EQUAL_INT16(INT16_MAX, drive_turning_mm_s_q4(&config, INT16_MAX));
    TEST_ASSERT_EQUAL_INT16(-INT16_MAX, drive_turning_mm_s_q4(&config, INT16_MIN));
}

static void test_drive_adds_friction_in_the_direction_of_motion(void)
{
    config.left.friction_mv = 564;
    TEST_ASSERT_EQUAL_INT16(2564, left(2000, AHEAD_Q4));
    TEST_ASSERT_EQUAL_INT16(-1436, left(-2000, AHEAD_Q4)); /* braking: friction helps */
    TEST_ASSERT_EQUAL_INT16(1436, left(2000, -AHEAD_Q4));
    TEST_ASSERT_EQUAL_INT16(564, left(0, DRIVE_STILL_MM_S_Q4));
    TEST_ASSERT_EQUAL_INT16(-564, left(0, -DRIVE_STILL_MM_S_Q4));
}

static void test_drive_adds_friction_at_rest_in_the_direction_that_is_wanted(void)
{
    config.left.friction_mv = 564;
    TEST_ASSERT_EQUAL_INT16(2564, left(2000, DRIVE_STILL_MM_S_Q4 - 1));
    TEST_ASSERT_EQUAL_INT16(-2564, left(-2000, DRIVE_STILL_MM_S_Q4 - 1));
    TEST_ASSERT_EQUAL_INT16(17 * 10, left(10, 0));
    TEST_ASSERT_EQUAL_INT16(0, left(0, 0));
}

static void test_drive_makes_up_for_a_dead_band(void)
{
    config.deadband_mv = 500;
    TEST_ASSERT_EQUAL_INT16(2500, left(2000, 0));
    TEST_ASSERT_EQUAL_INT16(-2500, left(-2000, AHEAD_Q4));
    TEST_ASSERT_EQUAL_INT16(0, left(0, AHEAD_Q4));
    for (int16_t wanted = -700; wanted < 700; wanted++) /* it never falls */
        TEST_ASSERT_LESS_THAN_INT16(left((int16_t)(wanted + 1), 0), left(wanted, 0));
}

static void test_drive_scales_each_side_by_its_own_gain(void)
{
    config.left.gain_q15 = -1560; /* 1 / 1.05 */
    config.right.gain_q15 = 1725; /* 1 / 0.95 */
    TEST_ASSERT_INT16_WITHIN(1, 3810, left(4000, 0));
    TEST_ASSERT_INT16_WITHIN(1, 4211, drive_voltage_mv(&config, &config.right, 4000, 0));
}

static void test_drive_adds_voltage_for_speed(void)
{
    config.left.emf_mv_q15 = 1261; /* 0.616 V s/m */
    TEST_ASSERT_INT16_WITHIN(1, 2000 + 185, left(2000, AHEAD_Q4));
    TEST_ASSERT_INT16_WITHIN(1, 2000 - 185, left(2000, -AHEAD_Q4));
}

static void test_drive_undoes_what_is_nearest_to_the_wheel_first(void)
{
    config.left = (drive_side_t){.gain_q15 = 16384, .emf_mv_q15 = 2048, .friction_mv = 400, .offset_mv = -100};
    config.deadband_mv = 300;
    /* (2000 + 300 - 100 + 400) * 1.5 + 300 */
    TEST_ASSERT_INT16_WITHIN(1, 4200, left(2000, AHEAD_Q4));
}

static void test_drive_is_the_same_forward_and_backward(void)
{
    for (int16_t speed = -8000; speed < 8000; speed = (int16_t)(speed + 77))
        for (int16_t wanted = -9000; wanted < 9000; wanted = (int16_t)(wanted + 171)) {
            config.left = (drive_side_t){.gain_q15 = 777, .emf_mv_q15 = -901, .friction_mv = 400, .offset_mv = 55};
            config.deadband_mv = 300;
            const int16_t forward = left(wanted, speed);
            config.left.offset_mv = -55;
            TEST_ASSERT_EQUAL_INT16(-forward, left((int16_t)-wanted, (int16_t)-speed));
        }
}

static void test_drive_saturates(void)
{
    config.left = (drive_side_t){.gain_q15 = 32767, .emf_mv_q15 = 32767, .friction_mv = 32000, .offset_mv = 32000};
    config.deadband_mv = 32000;
    TEST_ASSERT_EQUAL_INT16(INT16_MAX, left(INT16_MAX, INT16_MAX));
    config.left.offset_mv = -32000;
    TEST_ASSERT_EQUAL_INT16(-INT16_MAX, left(INT16_MIN, INT16_MIN));
}

static void test_drive_adds_the_smallest_friction_and_the_largest(void)
{
    config.left.friction_mv = 1;
    TEST_ASSERT_EQUAL_INT16(2001, left(2000, AHEAD_Q4));
    config.left.friction_mv = 30000;
    TEST_ASSERT_EQUAL_INT16(30000, left(0, AHEAD_Q4));
    TEST_ASSERT_EQUAL_INT16(-30000, left(0, -AHEAD_Q4));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_drive_of_nothing_changes_nothing);
    RUN_TEST(test_drive_turning_is_yaw_rate_times_half_track);
    RUN_TEST(test_drive_adds_friction_in_the_direction_of_motion);
    RUN_TEST(test_drive_adds_friction_at_rest_in_the_direction_that_is_wanted);
    RUN_TEST(test_drive_makes_up_for_a_dead_band);
    RUN_TEST(test_drive_scales_each_side_by_its_own_gain);
    RUN_TEST(test_drive_adds_voltage_for_speed);
    RUN_TEST(test_drive_undoes_what_is_nearest_to_the_wheel_first);
    RUN_TEST(test_drive_is_the_same_forward_and_backward);
    RUN_TEST(test_drive_saturates);
    RUN_TEST(test_drive_adds_the_smallest_friction_and_the_largest);
    return UNITY_END();
}
