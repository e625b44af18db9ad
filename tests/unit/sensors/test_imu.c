#include <math.h>

#include "sensors/imu.h"
#include "unity.h"

enum { COUNT = 100000 };

static imu_config_t config;
static imu_t imu;

void setUp(void)
{
    config = imu_config_default();
    imu_start(&imu, 5);
}
void tearDown(void) {}

static void statistics(const imu_reading_t *truth, double mean[3], double sd[3])
{
    double sum[3] = {0}, squares[3] = {0};
    for (int i = 0; i < COUNT; i++) {
        const imu_reading_t read = imu_read(&config, &imu, truth);
        const double off[3] = {read.accel_surge - truth->accel_surge, read.accel_sway - truth->accel_sway,
                               read.yaw_rate - truth->yaw_rate};
        for (int k = 0; k < 3; k++) {
            sum[k] += off[k];
            squares[k] += off[k] * off[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        mean[k] = sum[k] / COUNT;
        sd[k] = sqrt(squares[k] / COUNT - mean[k] * mean[k]);
    }
}

static void test_imu_bias_and_noise_are_as_configured(void)
{
    double mean[3], sd[3];
    config.bits = 0;
    statistics(&(imu_reading_t){1, -2, 3}, mean, sd);
    TEST_ASSERT_DOUBLE_WITHIN(4e-4, config.accel_bias_surge, mean[0]);
    TEST_ASSERT_DOUBLE_WITHIN(4e-4, config.accel_bias_sway, mean[1]);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4, config.gyro_bias, mean[2]);
    TEST_ASSERT_DOUBLE_WITHIN(3e-4, config.accel_noise_sd, sd[0]);
    TEST_ASSERT_DOUBLE_WITHIN(3e-4, config.accel_noise_sd, sd[1]);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4, config.gyro_noise_sd, sd[2]);
}

static void test_imu_quantisation_adds_its_variance(void)
{
    double mean[3], sd[3];
    statistics(&(imu_reading_t){0.3, 0.1, 0.2}, mean, sd);
    const double resolution = 2 * config.accel_range / 1024;
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, sqrt(0.025 * 0.025 + resolution * resolution / 12), sd[0]);
}

static void test_imu_readings_are_whole_steps_of_the_converter(void)
{
    const double resolution = 2 * config.gyro_range / 1024;
    for (int i = 0; i < 1000; i++) {
        const double steps = imu_read(&config, &imu, &(imu_reading_t){0, 0, 1.234}).yaw_rate / resolution;
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, round(steps), steps);
    }
}

static void test_imu_stays_at_the_end_of_its_range(void)
{
    const imu_reading_t beyond = imu_read(&config, &imu, &(imu_reading_t){40, -40, 17});
    TEST_ASSERT_EQUAL_DOUBLE(config.accel_range, beyond.accel_surge);
    TEST_ASSERT_EQUAL_DOUBLE(-config.accel_range, beyond.accel_sway);
    TEST_ASSERT_EQUAL_DOUBLE(config.gyro_range, beyond.yaw_rate);
}

static void test_imu_noise_is_the_seeds(void)
{
    const imu_reading_t truth = {0};
    config.bits = 0;
    const double first = imu_read(&config, &imu, &truth).yaw_rate;
    imu_start(&imu, 5);
    TEST_ASSERT_TRUE(first == imu_read(&config, &imu, &truth).yaw_rate);
    imu_start(&imu, 6);
    TEST_ASSERT_TRUE(first != imu_read(&config, &imu, &truth).yaw_rate);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_imu_bias_and_noise_are_as_configured);
    RUN_TEST(test_imu_quantisation_adds_its_variance);
    RUN_TEST(test_imu_readings_are_whole_steps_of_the_converter);
    RUN_TEST(test_imu_stays_at_the_end_of_its_range);
    RUN_TEST(test_imu_noise_is_the_seeds);
    return UNITY_END();
}
