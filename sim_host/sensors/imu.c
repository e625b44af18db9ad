#include "sensors/imu.h"

#include <math.h>

#include "models/rcx_gen.h"

imu_config_t imu_config_default(void)
{
    return (imu_config_t){.accel_noise_sd = RCX_IMU_ACCEL_NOISE_SD,
                          .accel_range = RCX_IMU_ACCEL_RANGE,
                          .accel_bias_surge = RCX_IMU_ACCEL_BIAS_SURGE,
                          .accel_bias_sway = RCX_IMU_ACCEL_BIAS_SWAY,
                          .gyro_noise_sd = RCX_IMU_GYRO_NOISE_SD,
                          .gyro_range = RCX_IMU_GYRO_RANGE,
                          .gyro_bias = RCX_IMU_GYRO_BIAS,
                          .bits = RCX_IMU_BITS};
}

void imu_start(imu_t *imu, uint64_t seed)
{
    random_start(&imu->random, seed);
}

static double convert(double value, double range, int bits)
{
    const double clipped = value > range ? range : value < -range ? -range : value;
    if (bits <= 0)
        return clipped;
    const double resolution = 2 * range / (double)(1L << bits);
    return resolution * round(clipped / resolution);
}

imu_reading_t imu_read(const imu_config_t *config, imu_t *imu, const imu_reading_t *truth)
{
    random_t *random = &imu->random;
    const double surge = truth->accel_surge + config->accel_bias_surge + config->accel_noise_sd * random_normal(random);
    const double sway = truth->accel_sway + config->accel_bias_sway + config->accel_noise_sd * random_normal(random);
    const double yaw_rate = truth->yaw_rate + config->gyro_bias + config->gyro_noise_sd * random_normal(random);
    return (imu_reading_t){.accel_surge = convert(surge, config->accel_range, config->bits),
                           .accel_sway = convert(sway, config->accel_range, config->bits),
                           .yaw_rate = convert(yaw_rate, config->gyro_range, config->bits)};
}
