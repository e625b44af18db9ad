/* i2c_imu.h: an MPU-6050 or an LSM6DS on the processor's I2C bus, by their data sheets: registers, ranges, "data
 * ready", the time from set-up to the first sample. Their filters are not simulated: a burst gives the motion at the
 * burst's start.
 */
#ifndef BRICKPILOT_SIM_AVR_I2C_IMU_H
#define BRICKPILOT_SIM_AVR_I2C_IMU_H

#include <simavr/avr_twi.h>
#include <stdbool.h>
#include <stdint.h>

typedef enum { I2C_MPU6050, I2C_LSM6DS, I2C_IMUS } i2c_imu_kind_t;

enum { I2C_REGISTERS = 128 };

/* rad/s and m/s^2, in the robot's directions: clockwise from above, forward, to the right. */
typedef struct {
    double yaw, surge, sway;
} i2c_motion_t;

typedef struct {
    avr_twi_t *bus;
    i2c_imu_kind_t kind;
    uint8_t registers[I2C_REGISTERS];
    uint8_t pointer;
    bool selected, pointed; /* the master addresses this chip; it has sent a register number */
    bool unpowered;         /* no supply: the chip does not answer */
    bool runs;
    uint64_t next_sample; /* cycle of the next sample */
    i2c_motion_t motion;
} i2c_imu_t;

/* Connects a chip to the bus in its state after power-on: the chip does not measure yet. */
void i2c_imu_connect(i2c_imu_t *imu, i2c_imu_kind_t kind, avr_twi_t *bus);

/* Switches the chip's supply off or on. After switching on, its registers are those of power-on. */
void i2c_imu_power(i2c_imu_t *imu, bool on);

#endif
