#include "app/params_gen.h"
#include "estimator/speed.h"
#include "unity.h"

static const speed_config_t *const CONFIG = &PARAMS_COUPLED.step.speed;
enum { Q17 = 131072 };
static speed_state_t state;
static signals_sensors_t sensors;
static signals_predicted_t predicted;
static signals_estimate_t estimate;
static int32_t correction_mm_s_q17;

void setUp(void)
{
    state = (speed_state_t){.speed_mm_s_q17 = 0};
    sensors = (signals_sensors_t){.period_ms = 3};
    predicted = (signals_predicted_t){.driven = false};
    estimate = (signals_estimate_t){.at_rest = false};
}

void tearDown(void) {}

static void step(int32_t predicted_mm_s_q17)
{
    predicted.motion.surge_mm_s_q17 = predicted_mm_s_q17;
    correction_mm_s_q17 = speed_step(CONFIG, &state, &sensors, &predicted, &estimate);
}

/* A model that would stay at its speed, and takes every correction. */
static void hold(int steps)
{
    for (int i = 0; i < steps; i++)
        step(state.speed_mm_s_q17);
}

/* Counts of a vehicle at this speed, from 0.25 counts on; 5.341 mm a count. */
static void roll(int speed_mm_s, int steps)
{
    sensors.have |= SENSOR_ROTATION;
    for (int i = 1; i <= steps; i++) {
        const int32_t travel_um = speed_mm_s * 3 * i + 1335;
        sensors.rotation_left = sensors.rotation_right = (uint16_t)(travel_um / 5341 + (travel_um < 0 ? -1 : 0));
        hold(1);
    }
}

static void test_speed_without_sensors_is_the_models(void)
{
    step(400 * Q17);
    TEST_ASSERT_EQUAL_INT16(400 * 16, estimate.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT32(0, correction_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(400 * 3 * 32 / 2, estimate.travel_um_q5);
}

static void test_speed_takes_its_share_of_the_accelerometer(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    sensors.accel_surge_mm_s2 = 1000;
    hold(1);
    TEST_ASSERT_INT32_WITHIN(300, 3 * Q17 / 5, correction_mm_s_q17);
}

static void test_speed_corrects_nothing_where_model_and_accelerometer_agree(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    sensors.accel_surge_mm_s2 = 1000;
    for (int i = 0; i < 100; i++)
        step(state.speed_mm_s_q17 + 3 * Q17);
    TEST_ASSERT_INT32_WITHIN(Q17 / 10, 300 * Q17, state.speed_mm_s_q17);
}

static void test_speed_knows_the_accelerometer_feels_turning(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    sensors.accel_surge_mm_s2 = -600;
    predicted.motion.sway_mm_s_q17 = 200 * Q17;
    estimate.yaw_rate_mrad_s = 3000;
    hold(100);
    TEST_ASSERT_INT32_WITHIN(Q17 / 10, 0, state.speed_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(200 * 3 * 2 * 16, estimate.sway_travel_um_q5);
}

static void test_speed_learns_the_accelerometers_bias_at_rest(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    estimate.at_rest = true;
    for (int i = 0; i < 4000; i++) {
        sensors.accel_surge_mm_s2 = i % 2 ? 70 : -10;
        step(Q17);
    }
    TEST_ASSERT_INT32_WITHIN(4096, 30 * 4096, state.bias.value);
    estimate.at_rest = false;
    sensors.accel_surge_mm_s2 = 30;
    hold(100);
    TEST_ASSERT_INT32_WITHIN(Q17, 0, state.speed_mm_s_q17);
}

static void test_speed_bias_saturates_and_its_count_stays(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    sensors.accel_surge_mm_s2 = -30000;
    estimate.at_rest = true;
    for (int32_t i = 0; i < 66000; i++)
        step(0);
    TEST_ASSERT_EQUAL_INT32(-1000L * 4096, state.bias.value);
    TEST_ASSERT_EQUAL_UINT16(65535, state.bias.learnt);
}

static void test_speed_is_zero_at_rest(void)
{
    estimate.at_rest = true;
    step(3 * Q17);
    TEST_ASSERT_EQUAL_INT16(0, estimate.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT32(-3 * Q17, correction_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(0, estimate.travel_um_q5);
}

static void test_speed_finds_the_speed_of_the_counts(void)
{
    roll(400, 2000);
    TEST_ASSERT_INT32_WITHIN(25 * Q17, 400 * Q17, state.speed_mm_s_q17);
}

static void test_speed_travel_keeps_to_the_counts(void)
{
    int32_t travel_um_q5 = 0;
    sensors.have = SENSOR_ROTATION;
    for (int i = 1; i <= 5000; i++) {
        sensors.rotation_left = sensors.rotation_right = (uint16_t)(300 * 3 * i / 5341);
        step(i < 2500 ? state.speed_mm_s_q17 : state.speed_mm_s_q17 / 100 * 99);
        travel_um_q5 += estimate.travel_um_q5;
    }
    TEST_ASSERT_INT32_WITHIN(60000, 300 * 3 * 5000, travel_um_q5 / 32);
}

/* Travel, mm, of 6 s at 400 mm/s in which only one of `every` steps has a reading. */
static int32_t travel_with_one_reading_in(int every)
{
    int32_t travel_um_q5 = 0;
    setUp();
    state.speed_mm_s_q17 = 400 * Q17;
    for (int i = 1; i <= 2000; i++) {
        sensors.have = i % every == 0 ? SENSOR_ROTATION : 0;
        sensors.rotation_left = sensors.rotation_right = (uint16_t)(400 * 3 * i / 5341);
        hold(1);
        travel_um_q5 += estimate.travel_um_q5;
    }
    TEST_ASSERT_INT32_WITHIN(10 * Q17, 400 * Q17, state.speed_mm_s_q17);
    return travel_um_q5 / 32000;
}

static void test_speed_counts_a_way_once_where_readings_are_missing(void)
{
    for (int every = 1; every <= 10; every++)
        TEST_ASSERT_INT32_WITHIN(10, 2400, travel_with_one_reading_in(every));
}

static void test_speed_keeps_what_it_travelled_unread_until_the_next_reading(void)
{
    const int32_t way_um_q5 = 400 * 3 * 32;
    sensors.have = SENSOR_ROTATION;
    step(400 * Q17);
    const int32_t residual_um_q5 = state.residual_um_q5;
    sensors.have = 0;
    step(400 * Q17);
    TEST_ASSERT_EQUAL_INT32(residual_um_q5 - way_um_q5, state.residual_um_q5);
    estimate.at_rest = true; /* its counts have not come yet */
    step(0);
    TEST_ASSERT_LESS_THAN_INT32(residual_um_q5 - way_um_q5 + 1, state.residual_um_q5);
    sensors.have = SENSOR_ROTATION;
    step(0);
    TEST_ASSERT_EQUAL_INT32(0, state.residual_um_q5);
}

static void test_speed_ignores_counts_from_before_the_first_step(void)
{
    sensors.have = SENSOR_ROTATION;
    sensors.rotation_left = sensors.rotation_right = 30000;
    hold(10);
    TEST_ASSERT_EQUAL_INT16(0, estimate.speed_mm_s_q4);
}

static void test_speed_counts_wrap_unnoticed(void)
{
    sensors.have = SENSOR_ROTATION;
    sensors.rotation_left = sensors.rotation_right = 65535;
    hold(1);
    sensors.rotation_left = sensors.rotation_right = 0;
    hold(1);
    TEST_ASSERT_INT32_WITHIN(5341 * 32 / 20, 5341 * 32, state.residual_um_q5);
}

static void test_speed_observer_forgets_what_slips(void)
{
    roll(0, 1);
    sensors.rotation_left = sensors.rotation_right = 2000;
    hold(1);
    TEST_ASSERT_EQUAL_INT32(SPEED_RESIDUAL_LIMIT_UM_Q5, state.residual_um_q5);
}

/* Travel behind after one step in which the wheels count this, with wheels of two sizes. */
static int32_t residual_um_q5(int16_t mismatch_q15, int left, int right)
{
    speed_config_t config = *CONFIG;
    config.count_mismatch_q15 = mismatch_q15;
    config.travel_gain_q15 = 0;
    setUp();
    sensors.have = SENSOR_ROTATION;
    for (int i = 0; i < 2; i++) {
        sensors.rotation_left = (uint16_t)(i * left);
        sensors.rotation_right = (uint16_t)(i * right);
        speed_step(&config, &state, &sensors, &predicted, &estimate);
    }
    return state.residual_um_q5;
}

static void test_speed_weighs_the_counts_of_unequal_wheels(void)
{
    const int32_t count_um_q5 = CONFIG->count_travel_um_q2 * 4; /* of both wheels' middle: half of one wheel's travel */
    TEST_ASSERT_INT32_WITHIN(20, count_um_q5 * 10 / 8 * 9, residual_um_q5(4096, 10, 0)); /* 9/8 of 10 counts */
    TEST_ASSERT_INT32_WITHIN(20, count_um_q5 * 10 / 8 * 7, residual_um_q5(4096, 0, 10));
    TEST_ASSERT_INT32_WITHIN(20, count_um_q5 * 20 / 8, residual_um_q5(4096, 10, -10));
    TEST_ASSERT_EQUAL_INT32(-residual_um_q5(4096, 7, 3), residual_um_q5(4096, -7, -3));
    TEST_ASSERT_EQUAL_INT32(residual_um_q5(4096, 7, 3), residual_um_q5(-4096, 3, 7));
}

static void test_speed_of_counts_without_end_saturates(void)
{
    speed_config_t config = *CONFIG;
    config.count_travel_um_q2 = 65535;
    config.count_mismatch_q15 = 32767;
    sensors.have = SENSOR_ROTATION;
    speed_step(&config, &state, &sensors, &predicted, &estimate);
    sensors.rotation_left = 32767;
    speed_step(&config, &state, &sensors, &predicted, &estimate);
    TEST_ASSERT_EQUAL_INT32(SPEED_RESIDUAL_LIMIT_UM_Q5, state.residual_um_q5);
}

static void test_speed_is_the_same_backward_bit_for_bit(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    sensors.accel_surge_mm_s2 = 321;
    predicted.motion.sway_mm_s_q17 = 12345678;
    estimate.yaw_rate_mrad_s = 777;
    roll(300, 500);
    const signals_estimate_t forward = estimate;
    const int32_t forward_correction = correction_mm_s_q17;
    setUp();
    sensors.have = SENSOR_ACCELEROMETER | SENSOR_ROTATION;
    sensors.accel_surge_mm_s2 = -321;
    predicted.motion.sway_mm_s_q17 = -12345678;
    estimate.yaw_rate_mrad_s = 777;
    for (int i = 1; i <= 500; i++) {
        sensors.rotation_left = sensors.rotation_right = (uint16_t)(0 - (300 * 3 * i + 1335) / 5341);
        hold(1);
    }
    TEST_ASSERT_NOT_EQUAL_INT32(0, forward_correction);
    TEST_ASSERT_EQUAL_INT32(-forward_correction, correction_mm_s_q17);
    TEST_ASSERT_EQUAL_INT16(-forward.speed_mm_s_q4, estimate.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT16(-forward.accel_mm_s2, estimate.accel_mm_s2);
    TEST_ASSERT_EQUAL_INT32(-forward.travel_um_q5, estimate.travel_um_q5);
}

static void test_speed_takes_the_reference_above_all(void)
{
    sensors.have = SENSOR_ACCELEROMETER | SENSOR_ROTATION | SENSOR_REFERENCE;
    sensors.accel_surge_mm_s2 = 5000;
    sensors.reference_speed_mm_s_q4 = -1234;
    step(400 * Q17);
    TEST_ASSERT_EQUAL_INT16(-1234, estimate.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT32(-1234 * (Q17 / 16) - 400 * Q17, correction_mm_s_q17);
}

static void assert_accel_of_a_ramp(uint8_t period_ms)
{
    setUp();
    sensors.period_ms = period_ms;
    for (int i = 1; i <= 100; i++)
        step(i * period_ms * (Q17 / 5));
    TEST_ASSERT_INT16_WITHIN(2, 200, estimate.accel_mm_s2);
}

static void test_speed_tells_its_rate_of_change_at_any_period(void)
{
    assert_accel_of_a_ramp(1);
    assert_accel_of_a_ramp(3);
    assert_accel_of_a_ramp(20);
}

static void test_speed_output_saturates(void)
{
    step(8000 * Q17);
    TEST_ASSERT_EQUAL_INT16(32767, estimate.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_INT32(0, correction_mm_s_q17);
}

/* Travel behind after one step in which both wheels count this, with the smallest wheels. */
static int32_t behind_of_counts(int counts)
{
    speed_config_t config = *CONFIG;
    config.count_travel_um_q2 = 1;
    config.count_mismatch_q15 = config.travel_gain_q15 = 0;
    setUp();
    sensors.have = SENSOR_ROTATION;
    for (int i = 0; i < 2; i++) {
        sensors.rotation_left = sensors.rotation_right = (uint16_t)(i * counts);
        speed_step(&config, &state, &sensors, &predicted, &estimate);
    }
    return state.residual_um_q5;
}

static void test_speed_takes_4096_counts_of_both_wheels_and_no_more(void)
{
    TEST_ASSERT_EQUAL_INT32(4095 * 4 + 4, behind_of_counts(2048));
    TEST_ASSERT_EQUAL_INT32(4096 * 4, behind_of_counts(2049));
    TEST_ASSERT_EQUAL_INT32(-4096 * 4, behind_of_counts(-2049));
    TEST_ASSERT_EQUAL_INT32(2047 * 8, behind_of_counts(2047));
}

static void test_speed_makes_up_for_no_more_than_its_limit_of_travel(void)
{
    speed_config_t config = *CONFIG;
    config.count_travel_um_q2 = 65535;
    config.count_mismatch_q15 = config.travel_gain_q15 = 32767;
    sensors.have = SENSOR_ROTATION;
    speed_step(&config, &state, &sensors, &predicted, &estimate);
    sensors.rotation_left = 4096;
    speed_step(&config, &state, &sensors, &predicted, &estimate);
    TEST_ASSERT_EQUAL_INT32(32767L << 15, estimate.travel_um_q5); /* of 2^30 */
}

static void test_speed_stays_within_its_limits(void)
{
    step(8191 * Q17);
    TEST_ASSERT_EQUAL_INT32(16380L * 65536, state.speed_mm_s_q17);
    step(-8191 * Q17);
    TEST_ASSERT_EQUAL_INT32(-16380L * 65536, state.speed_mm_s_q17);
    state.rotation_known = true; /* without a reading */
    state.residual_um_q5 = -536870900L;
    step(8191 * Q17);
    step(8191 * Q17);
    TEST_ASSERT_EQUAL_INT32(-536870912L, state.residual_um_q5);
}

/* The filtered acceleration, mm/s^2 q8, after a jump of this speed in 2 ms. */
static int32_t accel_of_jump(int32_t jump_mm_s_q17)
{
    speed_config_t config = *CONFIG;
    config.accel_filter_q15 = 32767;
    setUp();
    sensors.period_ms = 2;
    predicted.motion.surge_mm_s_q17 = jump_mm_s_q17;
    speed_step(&config, &state, &sensors, &predicted, &estimate);
    return state.accel_mm_s2_q8;
}

static void test_speed_takes_a_jump_of_4096_mm_s_for_an_acceleration_and_no_more(void)
{
    TEST_ASSERT_INT32_WITHIN(4000, 524272000,
                             accel_of_jump(4096 * Q17)); /* 2,048 m/s^2, by a filter of 32767 / 32768 */
    TEST_ASSERT_EQUAL_INT32(accel_of_jump(4096 * Q17), accel_of_jump(5000 * Q17));
    TEST_ASSERT_GREATER_THAN_INT32(accel_of_jump(8191L * 65536), accel_of_jump(4096 * Q17));
}

static void test_speed_takes_turning_out_of_the_accelerometer_to_the_mm_s2(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    step(0);
    TEST_ASSERT_EQUAL_INT32(0, correction_mm_s_q17);
    TEST_ASSERT_EQUAL_INT32(0, estimate.sway_travel_um_q5);
    sensors.accel_surge_mm_s2 = -30000;
    predicted.motion.sway_mm_s_q17 = 2000 * Q17;
    estimate.yaw_rate_mrad_s = 15000;
    step(0);
    TEST_ASSERT_EQUAL_INT32(0, correction_mm_s_q17);
}

static void test_speed_takes_the_first_sample_at_rest_for_the_bias(void)
{
    sensors.have = SENSOR_ACCELEROMETER;
    sensors.accel_surge_mm_s2 = 100;
    estimate.at_rest = true;
    step(0);
    TEST_ASSERT_EQUAL_INT32(100L * 4096, state.bias.value);
}

static void test_speed_turns_felt_acceleration_into_speed_to_a_ten_thousandth(void)
{
    speed_config_t config = *CONFIG;
    config.accel_gain_q15 = 32767;
    sensors.have = SENSOR_ACCELEROMETER;
    sensors.accel_surge_mm_s2 = 30000;
    speed_step(&config, &state, &sensors, &predicted, &estimate);
    TEST_ASSERT_INT32_WITHIN(350, 90 * (Q17 / 32768 * 32767), state.speed_mm_s_q17);
}

/* A driven robot with gyro and accelerometer, whose bias is known. */
static void drive_with_imu(void)
{
    sensors.have = SENSOR_GYRO | SENSOR_ACCELEROMETER;
    predicted.driven = true;
    state.bias.learnt = 64;
}

/* What a step adds to 300 mm/s in which the model adds 3 mm/s and the accelerometer nothing. */
static int32_t added_mm_s_q17(uint16_t trusted_ms)
{
    setUp();
    drive_with_imu();
    state.speed_mm_s_q17 = 300 * Q17;
    hold(1);
    state.friction.trusted_ms = trusted_ms & 511U;
    step(303 * Q17);
    return state.speed_mm_s_q17 - 300 * Q17;
}

static void test_speed_is_the_accelerometers_soon_after_a_rest_and_the_models_later(void)
{
    TEST_ASSERT_EQUAL_INT32(0, added_mm_s_q17(0));
    TEST_ASSERT_EQUAL_INT32(0, added_mm_s_q17(FRICTION_TRUSTED_MS - 3));
    TEST_ASSERT_INT32_WITHIN(Q17 / 100, 3 * Q17 * 4 / 5, added_mm_s_q17(FRICTION_TRUSTED_MS));
}

static void test_speed_is_zero_where_rest_is_seen(void)
{
    drive_with_imu();
    state.speed_mm_s_q17 = 30 * Q17;
    state.speed_mm_s_q4 = 30 * 16;
    hold(FRICTION_REST_STEPS - 1);
    TEST_ASSERT_NOT_EQUAL(0, estimate.speed_mm_s_q4);
    hold(2);
    TEST_ASSERT_EQUAL_INT16(0, estimate.speed_mm_s_q4);
}

/* The friction in force after a second in which the model says 1 m/s^2 more than the accelerometer. */
static int16_t friction_learnt(void)
{
    state.speed_mm_s_q17 = 300 * Q17;
    for (int i = 0; i < 333; i++)
        step(state.speed_mm_s_q17 + 3 * Q17);
    return friction_mv(&CONFIG->friction, &state.friction);
}

static void test_speed_learns_friction_of_the_accelerometer_alone(void)
{
    drive_with_imu();
    TEST_ASSERT_EQUAL_INT16(FRICTION_MOST_MV, friction_learnt());
    setUp();
    drive_with_imu();
    state.bias.learnt = 63;
    TEST_ASSERT_EQUAL_INT16(0, friction_learnt());
    setUp();
    drive_with_imu();
    sensors.have |= SENSOR_ROTATION;
    TEST_ASSERT_EQUAL_INT16(0, friction_learnt());
    sensors.have &= (uint8_t)~SENSOR_ROTATION; /* a reading that is missing is no IMU alone */
    TEST_ASSERT_EQUAL_INT16(0, friction_learnt());
    setUp();
    drive_with_imu();
    sensors.have |= SENSOR_REFERENCE;
    TEST_ASSERT_EQUAL_INT16(0, friction_learnt());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_speed_is_the_accelerometers_soon_after_a_rest_and_the_models_later);
    RUN_TEST(test_speed_is_zero_where_rest_is_seen);
    RUN_TEST(test_speed_learns_friction_of_the_accelerometer_alone);
    RUN_TEST(test_speed_without_sensors_is_the_models);
    RUN_TEST(test_speed_takes_its_share_of_the_accelerometer);
    RUN_TEST(test_speed_corrects_nothing_where_model_and_accelerometer_agree);
    RUN_TEST(test_speed_knows_the_accelerometer_feels_turning);
    RUN_TEST(test_speed_learns_the_accelerometers_bias_at_rest);
    RUN_TEST(test_speed_bias_saturates_and_its_count_stays);
    RUN_TEST(test_speed_is_zero_at_rest);
    RUN_TEST(test_speed_finds_the_speed_of_the_counts);
    RUN_TEST(test_speed_travel_keeps_to_the_counts);
    RUN_TEST(test_speed_counts_a_way_once_where_readings_are_missing);
    RUN_TEST(test_speed_keeps_what_it_travelled_unread_until_the_next_reading);
    RUN_TEST(test_speed_ignores_counts_from_before_the_first_step);
    RUN_TEST(test_speed_counts_wrap_unnoticed);
    RUN_TEST(test_speed_observer_forgets_what_slips);
    RUN_TEST(test_speed_weighs_the_counts_of_unequal_wheels);
    RUN_TEST(test_speed_of_counts_without_end_saturates);
    RUN_TEST(test_speed_is_the_same_backward_bit_for_bit);
    RUN_TEST(test_speed_takes_the_reference_above_all);
    RUN_TEST(test_speed_tells_its_rate_of_change_at_any_period);
    RUN_TEST(test_speed_output_saturates);
    RUN_TEST(test_speed_takes_4096_counts_of_both_wheels_and_no_more);
    RUN_TEST(test_speed_makes_up_for_no_more_than_its_limit_of_travel);
    RUN_TEST(test_speed_stays_within_its_limits);
    RUN_TEST(test_speed_takes_a_jump_of_4096_mm_s_for_an_acceleration_and_no_more);
    RUN_TEST(test_speed_takes_turning_out_of_the_accelerometer_to_the_mm_s2);
    RUN_TEST(test_speed_takes_the_first_sample_at_rest_for_the_bias);
    RUN_TEST(test_speed_turns_felt_acceleration_into_speed_to_a_ten_thousandth);
    return UNITY_END();
}
