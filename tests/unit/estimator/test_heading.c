#include "app/params_gen.h"
#include "estimator/heading.h"
#include "unity.h"

static const heading_config_t *const CONFIG = &PARAMS_COUPLED.step.heading;
static heading_state_t state;
static signals_sensors_t sensors;
static signals_predicted_t predicted;
static signals_estimate_t estimate;

void setUp(void)
{
    state = (heading_state_t){.heading_bam32 = 0};
    sensors = (signals_sensors_t){.have = SENSOR_GYRO, .period_ms = 3};
    predicted = (signals_predicted_t){.driven = false};
    estimate = (signals_estimate_t){.valid = false};
}

void tearDown(void) {}

static void run(int16_t rate_mrad_s, int steps)
{
    sensors.yaw_rate_mrad_s = rate_mrad_s;
    for (int i = 0; i < steps; i++)
        heading_step(CONFIG, &state, &sensors, &predicted, &estimate);
}

static void run_driven(int16_t rate_mrad_s, int steps)
{
    predicted.driven = true;
    run(rate_mrad_s, steps);
    predicted.driven = false;
}

static void test_heading_turns_3_rad_in_3_s_at_1_rad_s(void)
{
    state.raw_rate_mrad_s = 1000;
    run_driven(1000, 1000);
    TEST_ASSERT_UINT32_WITHIN(683565276U * 3 / 50000, 683565276U * 3, state.heading_bam32);
    TEST_ASSERT_EQUAL_UINT16((state.heading_bam32 + 32768U) >> 16, estimate.heading_bam16);
    TEST_ASSERT_EQUAL_INT16(1000, estimate.yaw_rate_mrad_s);
}

static void test_heading_takes_the_mean_of_two_samples(void)
{
    run_driven(1000, 1);
    TEST_ASSERT_UINT32_WITHIN(100, 1025348, state.heading_bam32);
}

static void test_heading_is_the_same_to_both_sides_bit_for_bit(void)
{
    run(17, 200);
    run_driven(1234, 777);
    const signals_estimate_t right = estimate;
    const uint32_t turned = state.heading_bam32;
    setUp();
    run(-17, 200);
    run_driven(-1234, 777);
    TEST_ASSERT_EQUAL_UINT32(0U - turned, state.heading_bam32);
    TEST_ASSERT_EQUAL_UINT16((uint16_t)(0U - right.heading_bam16), estimate.heading_bam16);
    TEST_ASSERT_EQUAL_INT16(-right.yaw_rate_mrad_s, estimate.yaw_rate_mrad_s);
}

static void test_heading_learns_the_bias_of_the_first_quiet_block(void)
{
    run(20, HEADING_BLOCK_STEPS - 1);
    TEST_ASSERT_FALSE(state.bias.learnt > 0);
    TEST_ASSERT_FALSE(estimate.at_rest);
    run(20, 1);
    TEST_ASSERT_TRUE(state.bias.learnt > 0);
    TEST_ASSERT_TRUE(estimate.at_rest);
    TEST_ASSERT_EQUAL_INT16(20 * 256, state.bias.value);
    TEST_ASSERT_EQUAL_INT16(0, estimate.yaw_rate_mrad_s);
}

static void test_heading_skips_samples_that_are_missing_from_a_block(void)
{
    for (int i = 0; i < HEADING_BLOCK_STEPS - 1; i++) {
        sensors.have = SENSOR_GYRO;
        run(20, 1);
        sensors.have = 0;
        run(9999, 2);
    }
    TEST_ASSERT_TRUE(estimate.bias_unknown);
    sensors.have = SENSOR_GYRO;
    run(20, 1);
    TEST_ASSERT_FALSE(estimate.bias_unknown);
    TEST_ASSERT_TRUE(estimate.at_rest);
    TEST_ASSERT_EQUAL_INT32(20 * 256, state.bias.value);
    sensors.have = 0;
    run(0, 1);
    TEST_ASSERT_TRUE(estimate.at_rest);
    run_driven(0, 1);
    TEST_ASSERT_FALSE(estimate.at_rest);
}

static void test_heading_begins_a_block_anew_where_something_moves_without_a_sample(void)
{
    run(20, HEADING_BLOCK_STEPS - 1);
    sensors.have = 0;
    run_driven(0, 1);
    sensors.have = SENSOR_GYRO;
    run(20, 1);
    TEST_ASSERT_TRUE(estimate.bias_unknown);
    run(20, HEADING_BLOCK_STEPS - 1);
    TEST_ASSERT_FALSE(estimate.bias_unknown);
}

static void test_heading_needs_no_bias_with_a_reference(void)
{
    run(20, 1);
    TEST_ASSERT_TRUE(estimate.bias_unknown);
    sensors.have |= SENSOR_REFERENCE;
    run(20, 1);
    TEST_ASSERT_FALSE(estimate.bias_unknown);
}

static void test_heading_counts_the_steps_with_the_gyro_at_the_end_of_its_range(void)
{
    const int16_t full = (int16_t)CONFIG->gyro_full_mrad_s;
    run_driven((int16_t)(full - 1), 3);
    run_driven((int16_t)(1 - full), 3);
    TEST_ASSERT_EQUAL_UINT16(0, state.full_steps);
    run_driven(full, 3);
    run_driven((int16_t)-full, 4);
    TEST_ASSERT_EQUAL_UINT16(7, state.full_steps);
    sensors.have = 0;
    run_driven(full, 3);
    sensors.have = SENSOR_GYRO | SENSOR_REFERENCE; /* which tells the heading, however fast it turns */
    run_driven(full, 3);
    TEST_ASSERT_EQUAL_UINT16(7, state.full_steps);
    sensors.have = SENSOR_GYRO;
    state.full_steps = 65534;
    run_driven(full, 3);
    TEST_ASSERT_EQUAL_UINT16(65535, state.full_steps);
}

static void test_heading_is_valid_for_as_long_as_blind_ms_says_and_no_longer(void)
{
    heading_config_t config = *CONFIG;
    config.blind_ms = 99;
    sensors.have = 0;
    for (int i = 1; i <= 34; i++) {
        heading_step(&config, &state, &sensors, &predicted, &estimate);
        TEST_ASSERT_EQUAL(i <= 33, estimate.valid);
    }
}

static void test_heading_averages_a_noisy_gyro_at_rest(void)
{
    uint32_t seed = 7;
    for (int i = 0; i < 40 * HEADING_BLOCK_STEPS; i++) {
        seed = seed * 1664525U + 1013904223U;
        run((int16_t)(20 + (int)((seed >> 8) % 81) - 40), 1);
    }
    TEST_ASSERT_INT16_WITHIN(256, 20 * 256, state.bias.value);
    TEST_ASSERT_TRUE(estimate.at_rest);
}

static void test_heading_bias_follows_slowly_once_learnt(void)
{
    run(20, 20 * HEADING_BLOCK_STEPS);
    run(36, 2 * HEADING_BLOCK_STEPS);
    TEST_ASSERT_INT16_WITHIN(100, 22 * 256, state.bias.value);
    run(36, 60 * HEADING_BLOCK_STEPS);
    TEST_ASSERT_INT16_WITHIN(256, 36 * 256, state.bias.value);
}

static void test_heading_does_not_drift_after_a_rest(void)
{
    run(20, 2 * HEADING_BLOCK_STEPS);
    const uint32_t before = state.heading_bam32;
    run_driven(20, 20000);
    TEST_ASSERT_UINT32_WITHIN(683565, before, state.heading_bam32);
}

static void test_heading_learns_nothing_while_driven(void)
{
    run_driven(20, 3 * HEADING_BLOCK_STEPS);
    TEST_ASSERT_FALSE(state.bias.learnt > 0);
}

static void test_heading_learns_nothing_while_the_model_moves(void)
{
    predicted.motion.surge_mm_s_q17 = -(CONFIG->rest_speed_mm_s_q4 + 1) * 8192;
    run(20, 3 * HEADING_BLOCK_STEPS);
    TEST_ASSERT_FALSE(estimate.at_rest);
}

static void test_heading_learns_nothing_while_the_wheels_count(void)
{
    sensors.have |= SENSOR_ROTATION;
    for (int i = 0; i < 8; i++) {
        sensors.rotation_left++;
        run(20, 40);
    }
    TEST_ASSERT_FALSE(state.bias.learnt > 0);
    run(20, HEADING_BLOCK_STEPS);
    TEST_ASSERT_TRUE(state.bias.learnt > 0);
    sensors.rotation_right--;
    run(20, 1);
    TEST_ASSERT_FALSE(estimate.at_rest);
    run(20, HEADING_BLOCK_STEPS); /* the wheel stands where it stood */
    TEST_ASSERT_TRUE(estimate.at_rest);
}

static void test_heading_learns_nothing_from_a_loud_gyro(void)
{
    for (int i = 0; i < 100; i++) {
        run(20, 10);
        run((int16_t)(21 + CONFIG->quiet_mrad_s), 10);
    }
    TEST_ASSERT_FALSE(state.bias.learnt > 0);
}

static void test_heading_bias_saturates_at_its_limit(void)
{
    run(1000, HEADING_BLOCK_STEPS);
    TEST_ASSERT_EQUAL_INT16(HEADING_BIAS_LIMIT_MRAD_S * 256, state.bias.value);
}

static void test_heading_takes_the_reference_above_all(void)
{
    run(500, 10);
    sensors.have |= SENSOR_REFERENCE;
    sensors.reference_heading_bam16 = 54321;
    sensors.reference_yaw_rate_mrad_s = -77;
    run(500, 1);
    TEST_ASSERT_EQUAL_UINT16(54321, estimate.heading_bam16);
    TEST_ASSERT_EQUAL_INT16(-77, estimate.yaw_rate_mrad_s);
}

static void test_heading_bridges_a_lost_gyro_by_the_model_and_says_when_too_long(void)
{
    run(20, HEADING_BLOCK_STEPS);
    run_driven(1020, 100);
    sensors.have = 0;
    predicted.motion.yaw_rate_mrad_s_q12 = 1000 * 4096;
    run_driven(0, 33);
    TEST_ASSERT_EQUAL_INT16(1000, estimate.yaw_rate_mrad_s);
    TEST_ASSERT_TRUE(estimate.valid);
    run_driven(0, 1);
    TEST_ASSERT_FALSE(estimate.valid);
    run_driven(0, 30000);
    TEST_ASSERT_FALSE(estimate.valid);
    sensors.have = SENSOR_GYRO;
    run_driven(1020, 1);
    TEST_ASSERT_TRUE(estimate.valid);
}

/* A gyro of which bias and scale are known beforehand, driven. */
static void run_known(int16_t bias_mrad_s, int16_t scale_q15, int16_t rate_mrad_s, int steps)
{
    heading_config_t known = *CONFIG;
    known.gyro_bias_mrad_s = bias_mrad_s;
    known.gyro_scale_q15 = scale_q15;
    sensors.yaw_rate_mrad_s = rate_mrad_s;
    predicted.driven = true;
    for (int i = 0; i < steps; i++)
        heading_step(&known, &state, &sensors, &predicted, &estimate);
    predicted.driven = false;
}

static void test_heading_takes_a_known_bias_out_without_a_rest(void)
{
    run_known(170, 0, 170, 1000);
    TEST_ASSERT_EQUAL_UINT32(0, state.heading_bam32);
    TEST_ASSERT_EQUAL_INT16(0, estimate.yaw_rate_mrad_s);
    run_known(170, 0, 1170, 1);
    TEST_ASSERT_EQUAL_INT16(1000, estimate.yaw_rate_mrad_s);
}

static void test_heading_learns_what_a_known_bias_leaves(void)
{
    heading_config_t known = *CONFIG;
    known.gyro_bias_mrad_s = 170;
    sensors.yaw_rate_mrad_s = 190;
    for (int i = 0; i < HEADING_BLOCK_STEPS; i++)
        heading_step(&known, &state, &sensors, &predicted, &estimate);
    TEST_ASSERT_EQUAL_INT16(20 * 256, state.bias.value);
}

static void test_heading_scales_what_a_known_bias_leaves(void)
{
    run_known(100, -2979, 1200, 1); /* 1 / 1.1 */
    TEST_ASSERT_EQUAL_INT16(1000, estimate.yaw_rate_mrad_s);
    run_known(100, -2979, -1000, 1);
    TEST_ASSERT_EQUAL_INT16(-1000, estimate.yaw_rate_mrad_s);
}

static void test_heading_of_a_known_gyro_is_the_same_to_both_sides_bit_for_bit(void)
{
    run_known(37, 1234, 777, 500);
    const uint32_t turned = state.heading_bam32;
    setUp();
    run_known(-37, 1234, -777, 500);
    TEST_ASSERT_EQUAL_UINT32(0U - turned, state.heading_bam32);
}

static void test_heading_of_a_known_gyro_saturates(void)
{
    run_known(-32767, 32767, 32767, 1);
    TEST_ASSERT_EQUAL_INT16(32767, estimate.yaw_rate_mrad_s);
    run_known(32767, 32767, -32767, 1);
    TEST_ASSERT_EQUAL_INT16(-32767, estimate.yaw_rate_mrad_s);
}

static void test_heading_leaves_the_models_yaw_rate_as_it_is(void)
{
    sensors.have = 0;
    predicted.motion.yaw_rate_mrad_s_q12 = 1000 * 4096;
    run_known(100, -2979, 0, 1);
    TEST_ASSERT_EQUAL_INT16(1000, estimate.yaw_rate_mrad_s);
}

static void test_heading_counts_the_blind_time_from_the_last_reading(void)
{
    heading_config_t config = *CONFIG;
    config.blind_ms = 99;
    for (int i = 0; i <= 34; i++) {
        sensors.have = i == 0 ? SENSOR_GYRO : 0;
        heading_step(&config, &state, &sensors, &predicted, &estimate);
        TEST_ASSERT_EQUAL(i <= 33, estimate.valid);
    }
}

static void test_heading_compares_all_rates_of_a_block_and_begins_one_from_nothing(void)
{
    run(0, 1);
    run((int16_t)CONFIG->quiet_mrad_s, 1);
    run(-1, 1); /* too far from the one before: no rest */
    run(-1, HEADING_BLOCK_STEPS - 1);
    TEST_ASSERT_FALSE(estimate.at_rest);
    run(-1, 1);
    TEST_ASSERT_TRUE(estimate.at_rest);
}

static void test_heading_turns_30_rad_to_3_parts_of_65536(void)
{
    run_driven(10000, 1);
    const uint16_t before_bam16 = estimate.heading_bam16;
    run_driven(10000, 1000);
    TEST_ASSERT_INT16_WITHIN(3, 0, (int16_t)(uint16_t)(estimate.heading_bam16 - before_bam16 - 50767U));
}

static void test_heading_is_at_rest_up_to_the_rest_speed(void)
{
    predicted.motion.surge_mm_s_q17 = CONFIG->rest_speed_mm_s_q4 * 8192L;
    run(20, HEADING_BLOCK_STEPS);
    TEST_ASSERT_TRUE(estimate.at_rest);
    predicted.motion.surge_mm_s_q17 += 8192;
    run(20, 1);
    TEST_ASSERT_FALSE(estimate.at_rest);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_heading_turns_3_rad_in_3_s_at_1_rad_s);
    RUN_TEST(test_heading_takes_the_mean_of_two_samples);
    RUN_TEST(test_heading_is_the_same_to_both_sides_bit_for_bit);
    RUN_TEST(test_heading_learns_the_bias_of_the_first_quiet_block);
    RUN_TEST(test_heading_skips_samples_that_are_missing_from_a_block);
    RUN_TEST(test_heading_begins_a_block_anew_where_something_moves_without_a_sample);
    RUN_TEST(test_heading_needs_no_bias_with_a_reference);
    RUN_TEST(test_heading_counts_the_steps_with_the_gyro_at_the_end_of_its_range);
    RUN_TEST(test_heading_is_valid_for_as_long_as_blind_ms_says_and_no_longer);
    RUN_TEST(test_heading_averages_a_noisy_gyro_at_rest);
    RUN_TEST(test_heading_bias_follows_slowly_once_learnt);
    RUN_TEST(test_heading_does_not_drift_after_a_rest);
    RUN_TEST(test_heading_learns_nothing_while_driven);
    RUN_TEST(test_heading_learns_nothing_while_the_model_moves);
    RUN_TEST(test_heading_learns_nothing_while_the_wheels_count);
    RUN_TEST(test_heading_learns_nothing_from_a_loud_gyro);
    RUN_TEST(test_heading_bias_saturates_at_its_limit);
    RUN_TEST(test_heading_takes_the_reference_above_all);
    RUN_TEST(test_heading_bridges_a_lost_gyro_by_the_model_and_says_when_too_long);
    RUN_TEST(test_heading_takes_a_known_bias_out_without_a_rest);
    RUN_TEST(test_heading_learns_what_a_known_bias_leaves);
    RUN_TEST(test_heading_scales_what_a_known_bias_leaves);
    RUN_TEST(test_heading_of_a_known_gyro_is_the_same_to_both_sides_bit_for_bit);
    RUN_TEST(test_heading_of_a_known_gyro_saturates);
    RUN_TEST(test_heading_leaves_the_models_yaw_rate_as_it_is);
    RUN_TEST(test_heading_counts_the_blind_time_from_the_last_reading);
    RUN_TEST(test_heading_compares_all_rates_of_a_block_and_begins_one_from_nothing);
    RUN_TEST(test_heading_turns_30_rad_to_3_parts_of_65536);
    RUN_TEST(test_heading_is_at_rest_up_to_the_rest_speed);
    return UNITY_END();
}
