#include "avr/digital.h"

#include <stdbool.h>
#include <util/atomic.h>

#include "avr/board.h"
#include "avr/twi.h"
#include "hal.h"

#if BOARD_IMU == BOARD_ANALOGUE

void digital_start(void) {}
void digital_begin(void) {}
void digital_end(void) {}

uint16_t digital_faults(void)
{
    return 0;
}

#else

typedef struct {
    uint8_t at, value;
} setting_t;

/* For each sensor: its address, the WHO_AM_I values of its chips, its settings, the burst (first register, size, bits
 * of the first byte that say "new data"), the place of each value in the burst, and mrad/s or mm/s^2 per count, times
 * 65536. Both sensors have ranges of 1,000 degrees/s and 2 g, and a bandwidth of 150 to 190 Hz. */
#if BOARD_IMU == BOARD_MPU6050
/* InvenSense, MPU-6000/6050 register map 4.2; the MPU-6500, 9250 and 9255 have the same registers. Data: high byte first. */
enum { ADDRESS = 0x68 | BOARD_IMU_SECOND_ADDRESS, WHO_AM_I = 0x75, BURST = 0x3A, SIZE = 15, READY = 1 };
enum { SURGE_AT = 1, SWAY_AT = 3, YAW_AT = 13, HIGH = 0, LOW = 1 };
static const __flash uint8_t NAMES[] = {0x68, 0x70, 0x71, 0x73};
static const __flash setting_t SETTINGS[] = {
    {0x6B, 0x01}, /* PWR_MGMT_1: awake, clocked by the gyro */
    {0x1A, 0x01}, /* CONFIG: the filter of 184 Hz */
    {0x19, 0x00}, /* SMPLRT_DIV: 1 kHz */
    {0x1B, 0x10}, /* GYRO_CONFIG: 1,000 degrees/s */
    {0x1C, 0x00}, /* ACCEL_CONFIG: 2 g */
    {0x38, 0x01}, /* INT_ENABLE: data ready */
};
#define YAW_Q16 34873UL   /* 32.8 counts per degree/s */
#define FORCE_Q16 39227UL /* 16,384 counts per g */
#else
/* ST, LSM6DS3, LSM6DSL, LSM6DS3TR-C, LSM6DSO: low byte first. */
enum { ADDRESS = 0x6A | BOARD_IMU_SECOND_ADDRESS, WHO_AM_I = 0x0F, BURST = 0x1E, SIZE = 14, READY = 3 };
enum { YAW_AT = 8, SURGE_AT = 10, SWAY_AT = 12, HIGH = 1, LOW = 0 };
static const __flash uint8_t NAMES[] = {0x69, 0x6A, 0x6C};
static const __flash setting_t SETTINGS[] = {
    {0x12, 0x44}, /* CTRL3_C: both bytes of a value are of one sample; a burst reads register after register */
    {0x10, 0x70}, /* CTRL1_XL: 833 Hz, 2 g */
    {0x11, 0x78}, /* CTRL2_G: 833 Hz, 1,000 degrees/s */
};
#define YAW_Q16 40034UL   /* 0.035 degree/s per count */
#define FORCE_Q16 39204UL /* 61 millionths of g per count */
#endif

enum { ASK = 0, FIRST_SETTING = 1, RUN = FIRST_SETTING + sizeof SETTINGS / sizeof SETTINGS[0] };
enum { FRESH_TICKS = 1, START_TICKS = 100 / BOARD_TICK_MS }; /* the slower chip gives data 80 ms after it is set up */

typedef struct {
    int16_t surge, sway, yaw;
} counts_t;

static uint8_t at;           /* ASK, the setting that is written next, or RUN */
static uint8_t without_data; /* ticks in RUN without new data */
static counts_t newest;
static uint8_t age = 255; /* ticks since the newest reading; saturates at 255 */
static uint16_t faults;
static bool begun;

static void count_fault(void)
{
    if (faults < 65535U)
        faults++;
}

void digital_start(void)
{
    twi_start();
}

void digital_begin(void)
{
    uint8_t out[TWI_OUT] = {WHO_AM_I, 0};

    if (at == RUN) {
        out[0] = BURST;
    } else if (at >= FIRST_SETTING) {
        out[0] = SETTINGS[at - FIRST_SETTING].at;
        out[1] = SETTINGS[at - FIRST_SETTING].value;
    }
    twi_begin(ADDRESS, out, at == ASK || at == RUN ? 1 : 2, at == RUN ? SIZE : at == ASK ? 1 : 0);
    begun = true;
}

static bool is_known(uint8_t name)
{
    for (uint8_t i = 0; i < sizeof NAMES; i++)
        if (NAMES[i] == name)
            return true;
    return false;
}

static int16_t value_at(const uint8_t *bytes)
{
    return (int16_t)((uint16_t)bytes[HIGH] << 8 | bytes[LOW]);
}

static void take(const uint8_t *burst)
{
    if ((burst[0] & READY) == READY) {
        newest = (counts_t){value_at(burst + SURGE_AT), value_at(burst + SWAY_AT), value_at(burst + YAW_AT)};
        age = without_data = 0;
        return;
    }
    count_fault();
    if (++without_data >= START_TICKS)
        at = ASK;
}

void digital_end(void)
{
    const twi_state_t state = begun ? twi_state() : TWI_DONE;

    if (age < 255)
        age++;
    if (!begun)
        return;
    if (state == TWI_BUSY)
        twi_free();
    if (state != TWI_DONE || (at == ASK && !is_known(twi_received()[0]))) {
        count_fault();
        at = ASK;
        without_data = 0;
    } else if (at == RUN) {
        take(twi_received());
    } else {
        at++;
    }
}

uint16_t digital_faults(void)
{
    uint16_t counted;

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        counted = faults;
    }
    return counted;
}

static int16_t scaled(int16_t counts, uint32_t per_count_q16, bool reversed)
{
    const uint16_t size = counts < 0 ? (uint16_t) - (uint16_t)counts : (uint16_t)counts;
    const int16_t value = (int16_t)((size * per_count_q16 + 32768UL) >> 16);

    return (counts < 0) != reversed ? (int16_t)-value : value;
}

/* The chip lies with its x axis forward and its face up: its y axis points left, its yaw rate counter-clockwise. */
hal_status_t hal_imu_read(hal_imu_t *out)
{
    counts_t now;
    bool fresh;

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        now = newest;
        fresh = age <= FRESH_TICKS;
    }
    if (!fresh)
        return HAL_STALE;
    out->yaw_rate_mrad_s = scaled(now.yaw, YAW_Q16, !BOARD_GYRO_REVERSED);
#ifdef AVR_ACCELEROMETER
    out->accel_surge_mm_s2 = scaled(now.surge, FORCE_Q16, BOARD_SURGE_REVERSED);
    out->accel_sway_mm_s2 = scaled(now.sway, FORCE_Q16, !BOARD_SWAY_REVERSED);
    return HAL_OK;
#else
    return HAL_PARTLY;
#endif
}

#endif
