#include "avr/i2c_imu.h"

#include <math.h>
#include <simavr/sim_avr.h>
#include <string.h>

static const double G = 9.80665, DEGREE = 0.017453292519943295;
enum { KHZ = 16000 }; /* cycles in 1 ms */

/* InvenSense RM-MPU-6000A 4.2 and PS-MPU-6000A 3.4; ST DS LSM6DSO rev 2. */
enum {
    MPU_ADDRESS = 0x68,
    MPU_RATE_DIVIDER = 0x19,
    MPU_CONFIG = 0x1A,
    MPU_GYRO_CONFIG = 0x1B,
    MPU_ACCEL_CONFIG = 0x1C,
    MPU_STATUS = 0x3A,
    MPU_ACCEL = 0x3B,
    MPU_GYRO = 0x43,
    MPU_POWER = 0x6B,
    MPU_NAME = 0x75,
    MPU_ASLEEP = 0x40,
    MPU_DATA = 1
};
enum {
    LSM_ADDRESS = 0x6A,
    LSM_NAME = 0x0F,
    LSM_ACCEL = 0x10,
    LSM_GYRO = 0x11,
    LSM_CONTROL = 0x12,
    LSM_FOLLOWS = 4,
    LSM_STATUS = 0x1E,
    LSM_GYRO_DATA = 0x22,
    LSM_ACCEL_DATA = 0x28,
    LSM_ACCEL_NEW = 1,
    LSM_GYRO_NEW = 2
};

static uint16_t limited(double counts)
{
    const double whole = round(counts);
    return (uint16_t)(int16_t)(whole > 32767 ? 32767 : whole < -32768 ? -32768 : whole);
}

static void put(i2c_imu_t *imu, uint8_t at, double counts)
{
    const uint16_t value = limited(counts);
    const int high = imu->kind == I2C_MPU6050 ? 0 : 1;

    imu->registers[at + high] = (uint8_t)(value >> 8);
    imu->registers[at + 1 - high] = (uint8_t)value;
}

/* The chip lies on the robot with x forward, y to the left and z up. */
static void put_axes(i2c_imu_t *imu, uint8_t accel, double per_force, uint8_t gyro, double per_rate)
{
    put(imu, accel, imu->motion.surge * per_force);
    put(imu, (uint8_t)(accel + 2), -imu->motion.sway * per_force);
    put(imu, (uint8_t)(accel + 4), G * per_force);
    put(imu, gyro, 0);
    put(imu, (uint8_t)(gyro + 2), 0);
    put(imu, (uint8_t)(gyro + 4), -imu->motion.yaw * per_rate);
}

static void sample_mpu(i2c_imu_t *imu)
{
    const double force = 16384 / G / (1 << (imu->registers[MPU_ACCEL_CONFIG] >> 3 & 3));
    const double rate = 131.072 / DEGREE / (1 << (imu->registers[MPU_GYRO_CONFIG] >> 3 & 3));

    put_axes(imu, MPU_ACCEL, force, MPU_GYRO, rate);
    imu->registers[MPU_STATUS] |= MPU_DATA;
}

static void sample_lsm(i2c_imu_t *imu)
{
    static const double FORCE_MG[] = {0.061, 0.488, 0.122, 0.244}, RATE_MDPS[] = {8.75, 17.5, 35, 70};
    const uint8_t force = imu->registers[LSM_ACCEL] >> 2 & 3, rate = imu->registers[LSM_GYRO] >> 2 & 3;

    put_axes(imu, LSM_ACCEL_DATA, 1e3 / (FORCE_MG[force] * G), LSM_GYRO_DATA, 1e3 / (RATE_MDPS[rate] * DEGREE));
    imu->registers[LSM_STATUS] = (uint8_t)((imu->registers[LSM_ACCEL] >> 4 ? LSM_ACCEL_NEW : 0) |
                                           (imu->registers[LSM_GYRO] >> 4 ? LSM_GYRO_NEW : 0));
}

/* Cycles between two samples; 0: the IMU does not measure. */
static uint64_t period(const i2c_imu_t *imu)
{
    static const double HZ[] = {0, 12.5, 26, 52, 104, 208, 416, 833, 1666, 3332, 6664};

    if (imu->kind == I2C_MPU6050) {
        const uint8_t filter = imu->registers[MPU_CONFIG] & 7;
        const uint64_t base = filter == 0 || filter == 7 ? KHZ / 8 : KHZ;
        return imu->registers[MPU_POWER] & MPU_ASLEEP ? 0 : base * (1U + imu->registers[MPU_RATE_DIVIDER]);
    }
    const uint8_t rate = imu->registers[LSM_GYRO] >> 4;
    return rate == 0 || rate > 10 ? 0 : (uint64_t)(1e3 * KHZ / HZ[rate]);
}

/* Cycles from the IMU's set-up to the gyro's first sample. */
static uint64_t start_up(const i2c_imu_t *imu)
{
    return imu->kind == I2C_MPU6050 ? 30 * KHZ : 70 * KHZ;
}

static void measure(i2c_imu_t *imu)
{
    const uint64_t now = imu->bus->io.avr->cycle, each = period(imu);

    if (each == 0) {
        imu->runs = false;
        return;
    }
    if (!imu->runs) {
        imu->runs = true;
        imu->next_sample = now + start_up(imu);
    }
    if (now < imu->next_sample)
        return;
    imu->next_sample = now + each - (now - imu->next_sample) % each;
    if (imu->kind == I2C_MPU6050)
        sample_mpu(imu);
    else
        sample_lsm(imu);
}

static void set_up(i2c_imu_t *imu)
{
    memset(imu->registers, 0, sizeof imu->registers);
    imu->registers[imu->kind == I2C_MPU6050 ? MPU_NAME : LSM_NAME] = imu->kind == I2C_MPU6050 ? 0x68 : 0x6C;
    if (imu->kind == I2C_MPU6050)
        imu->registers[MPU_POWER] = MPU_ASLEEP;
    else
        imu->registers[LSM_CONTROL] = LSM_FOLLOWS;
    imu->selected = imu->runs = false;
}

static void advance(i2c_imu_t *imu)
{
    if (imu->kind == I2C_MPU6050 || imu->registers[LSM_CONTROL] & LSM_FOLLOWS)
        imu->pointer = (uint8_t)((imu->pointer + 1) % I2C_REGISTERS);
}

static void take(i2c_imu_t *imu, uint8_t byte)
{
    if (!imu->pointed) {
        imu->pointer = byte % I2C_REGISTERS;
        imu->pointed = true;
        return;
    }
    imu->registers[imu->pointer] = byte;
    advance(imu);
    measure(imu);
}

/* Gives a byte to the master. The flag "data ready" is cleared when it is read (MPU-6050) or when data are read
 * (LSM6DS). */
static uint8_t give(i2c_imu_t *imu)
{
    const uint8_t byte = imu->registers[imu->pointer];

    if (imu->kind == I2C_MPU6050 && imu->pointer == MPU_STATUS)
        imu->registers[MPU_STATUS] = 0;
    if (imu->kind == I2C_LSM6DS && imu->pointer == LSM_GYRO_DATA + 5)
        imu->registers[LSM_STATUS] &= (uint8_t)~LSM_GYRO_NEW;
    if (imu->kind == I2C_LSM6DS && imu->pointer == LSM_ACCEL_DATA + 3)
        imu->registers[LSM_STATUS] &= (uint8_t)~LSM_ACCEL_NEW;
    advance(imu);
    return byte;
}

static void answer(const i2c_imu_t *imu, uint8_t what, uint8_t byte)
{
    avr_raise_irq(imu->bus->io.irq + TWI_IRQ_INPUT, avr_twi_irq_msg(what, 0, byte));
}

/* Each message of simavr is a condition on the bus. The address byte's last bit says whether the master reads. */
static void on_bus(avr_irq_t *irq, uint32_t value, void *param)
{
    i2c_imu_t *imu = param;
    const uint8_t address = imu->kind == I2C_MPU6050 ? MPU_ADDRESS : LSM_ADDRESS;
    avr_twi_msg_irq_t message;

    (void)irq;
    message.u.v = value;
    if (message.u.twi.msg & TWI_COND_STOP)
        imu->selected = false;
    if (message.u.twi.msg & TWI_COND_START) {
        imu->selected = !imu->unpowered && message.u.twi.addr >> 1 == address;
        imu->pointed = false;
        if (imu->selected) {
            measure(imu);
            answer(imu, TWI_COND_ACK, 1);
        }
    }
    if (!imu->selected)
        return;
    if (message.u.twi.msg & TWI_COND_WRITE) {
        take(imu, message.u.twi.data);
        answer(imu, TWI_COND_ACK, 1);
    }
    if (message.u.twi.msg & TWI_COND_READ)
        answer(imu, TWI_COND_READ, give(imu));
}

void i2c_imu_connect(i2c_imu_t *imu, i2c_imu_kind_t kind, avr_twi_t *bus)
{
    *imu = (i2c_imu_t){.bus = bus, .kind = kind};
    set_up(imu);
    avr_irq_register_notify(bus->io.irq + TWI_IRQ_OUTPUT, on_bus, imu);
}

void i2c_imu_power(i2c_imu_t *imu, bool on)
{
    imu->unpowered = !on;
    imu->selected = false;
    if (!on)
        set_up(imu);
}
