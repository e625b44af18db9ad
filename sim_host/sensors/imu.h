/* imu.h: two accelerometers and a gyro on the brick's converter. A reading is the true value plus a bias and white
 * noise, limited to the range and rounded to the resolution. */
#ifndef BRICKPILOT_SENSORS_IMU_H
#define BRICKPILOT_SENSORS_IMU_H

#include "sensors/random.h"

typedef struct {
    double accel_noise_sd;   /* m/s^2, per reading */
    double accel_range;      /* m/s^2, both signs; a reading never exceeds it */
    double accel_bias_surge; /* m/s^2 */
    double accel_bias_sway;
    double gyro_noise_sd; /* rad/s */
    double gyro_range;    /* rad/s */
    double gyro_bias;     /* rad/s */
    int bits;             /* bits of the converter, 1..24: the resolution is 2 range / 2^bits; 0: no rounding */
} imu_config_t;

typedef struct {
    random_t random;
} imu_t;

typedef struct {
    double accel_surge; /* m/s^2, specific force */
    double accel_sway;
    double yaw_rate; /* rad/s */
} imu_reading_t;

/* Returns the robot's values: [sensors.imu] of models/rcx.toml. */
imu_config_t imu_config_default(void);

/* Starts the noise from any seed. */
void imu_start(imu_t *imu, uint64_t seed);

/* Returns the reading of `truth`. Each call draws new noise. */
imu_reading_t imu_read(const imu_config_t *config, imu_t *imu, const imu_reading_t *truth);

#endif
