#include <string.h>

#include "app/compensation.h"
#include "app/params_gen.h"
#include "unity.h"

static loop_config_t config;

void setUp(void)
{
    memcpy(&config, &PARAMS_COUPLED, sizeof config);
}
void tearDown(void) {}

static void test_compensation_of_nothing_leaves_every_constant(void)
{
    static const compensation_t NOTHING;
    loop_config_t before;
    memcpy(&before, &config, sizeof before);
    compensation_apply(&NOTHING, &config);
    TEST_ASSERT_EQUAL_MEMORY(&before, &config, sizeof config);
}

static drive_side_t side(int16_t first)
{
    return (drive_side_t){.gain_q15 = first,
                          .emf_mv_q15 = (int16_t)(first + 1),
                          .friction_mv = (int16_t)(first + 2),
                          .offset_mv = (int16_t)(first + 3)};
}

static void assert_side(int first, const drive_side_t *found)
{
    TEST_ASSERT_EQUAL_INT16(first, found->gain_q15);
    TEST_ASSERT_EQUAL_INT16(first + 1, found->emf_mv_q15);
    TEST_ASSERT_EQUAL_INT16(first + 2, found->friction_mv);
    TEST_ASSERT_EQUAL_INT16(first + 3, found->offset_mv);
}

static void test_compensation_reaches_every_stage(void)
{
    const compensation_t all = {
        .drive = {.left = side(10), .right = side(20), .deadband_mv = 30, .half_track_m_q14 = 31, .reserve_mv = 32},
        .battery_sags = true,
        .gyro_bias_mrad_s = 40,
        .gyro_scale_q15 = 41,
        .count_mismatch_q15 = 42};
    compensation_apply(&all, &config);
    assert_side(10, &config.step.mixer.drive.left);
    assert_side(20, &config.step.mixer.drive.right);
    TEST_ASSERT_EQUAL_INT16(30, config.step.mixer.drive.deadband_mv);
    TEST_ASSERT_EQUAL_INT16(31, config.step.mixer.drive.half_track_m_q14);
    TEST_ASSERT_EQUAL_INT16(32, config.step.mixer.drive.reserve_mv);
    TEST_ASSERT_TRUE(config.step.battery_sags);
    TEST_ASSERT_EQUAL_INT16(40, config.step.heading.gyro_bias_mrad_s);
    TEST_ASSERT_EQUAL_INT16(41, config.step.heading.gyro_scale_q15);
    TEST_ASSERT_EQUAL_INT16(42, config.step.speed.count_mismatch_q15);
}

static void test_compensation_scales_the_travel_of_a_count(void)
{
    const compensation_t less = {.travel_scale_q15 = -2979}; /* 1 / 1.1 */
    compensation_apply(&less, &config);
    TEST_ASSERT_UINT16_WITHIN(1, PARAMS_COUPLED.step.speed.count_travel_um_q2 / 1.1,
                              config.step.speed.count_travel_um_q2);
}

static void test_compensation_of_the_travel_saturates(void)
{
    const compensation_t more = {.travel_scale_q15 = 32767};
    config.step.speed.count_travel_um_q2 = 40000;
    compensation_apply(&more, &config);
    TEST_ASSERT_EQUAL_UINT16(65535, config.step.speed.count_travel_um_q2);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_compensation_of_nothing_leaves_every_constant);
    RUN_TEST(test_compensation_reaches_every_stage);
    RUN_TEST(test_compensation_scales_the_travel_of_a_count);
    RUN_TEST(test_compensation_of_the_travel_saturates);
    return UNITY_END();
}
