#include "rcx/sensors.h"

#include "hal.h"
#include "rcx/board.h"

/* The 10 bits of a converter's reading are the highest bits of a word. */
enum { RAW_ONE = 64, RAW_MAX = 0xFFC0 };

/* mV per count of the battery's converter: 43988 / 1560, as a whole part and a fraction. The formula is that of
 * brickOS. More than 709 counts would mean more than 20 V. */
enum { BATTERY_WHOLE = 28, BATTERY_OVER = 77, BATTERY_UNDER = 390, BATTERY_MOST = 709 };

void sensors_start(void)
{
#ifdef RCX_ROTATION
    ds_activation = BOARD_COUNTING_INPUTS;
    ds_rotation_set(&BOARD_LEFT_INPUT, 0);
    ds_rotation_set(&BOARD_RIGHT_INPUT, 0);
    ds_rotation = BOARD_COUNTING_INPUTS;
#endif
    /* The other inputs stay passive: the kernel makes every input passive when it starts a program. */
}

static uint16_t raw_of(uint16_t converter)
{
    return (uint16_t)((converter >> 8) << 2 | (uint8_t)converter >> 6);
}

static bool connected(uint16_t converter)
{
    return converter >= RAW_ONE && converter < RAW_MAX;
}

/* Multiplies in parts of 8 x 8 bits: the processor has no other multiplication. */
static uint16_t times(uint16_t counts, uint8_t factor)
{
    return (uint16_t)((uint8_t)(counts >> 8) * factor << 8) + (uint8_t)counts * factor;
}

static int16_t scaled(const board_axis_t *axis, uint16_t converter)
{
    uint16_t counts = raw_of(converter) - axis->zero_raw;
    const bool below = (int16_t)counts < 0;
    int16_t size;

    if (below)
        counts = -counts;
    size = (int16_t)(times(counts, axis->per_count) + (uint8_t)(counts >> 8) * axis->per_count_256 +
                     ((uint16_t)((uint8_t)counts * axis->per_count_256) >> 8));
    return below != axis->reversed ? -size : size;
}

hal_status_t hal_imu_read(hal_imu_t *out)
{
    const uint16_t gyro = BOARD_GYRO_INPUT;
#ifdef RCX_ROTATION
    if (!connected(gyro))
        return HAL_STALE;
    out->yaw_rate_mrad_s = scaled(&BOARD_GYRO, gyro);
    return HAL_PARTLY;
#else
    const uint16_t surge = BOARD_SURGE_INPUT;
    const uint16_t sway = BOARD_SWAY_INPUT;

    if (!connected(gyro) || !connected(surge) || !connected(sway))
        return HAL_STALE;
    out->yaw_rate_mrad_s = scaled(&BOARD_GYRO, gyro);
    out->accel_surge_mm_s2 = scaled(&BOARD_SURGE, surge);
    out->accel_sway_mm_s2 = scaled(&BOARD_SWAY, sway);
    return HAL_OK;
#endif
}

#ifdef RCX_ROTATION
static uint16_t counts_of(int16_t count, bool reversed)
{
    return reversed ? -(uint16_t)count : (uint16_t)count;
}

/* A sensor that is not plugged in counts nothing, and so looks like a wheel at rest. */
hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    out->left = counts_of(BOARD_LEFT_COUNT, BOARD_LEFT_REVERSED);
    out->right = counts_of(BOARD_RIGHT_COUNT, BOARD_RIGHT_REVERSED);
    return HAL_OK;
}
#else
hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    (void)out;
    return HAL_ABSENT;
}
#endif

hal_status_t hal_reference_read(hal_reference_t *out)
{
    (void)out;
    return HAL_ABSENT;
}

/* Divides with the processor's own instruction, since the compiler would call the library. The quotient must be below 256. */
static uint8_t quotient(uint16_t of, uint8_t by)
{
    __asm__("divxu.b %X1,%0" : "+r"(of) : "r"(by));
    return (uint8_t)of;
}

hal_status_t hal_battery_read(uint16_t *out_mv)
{
    uint16_t raw = raw_of(BATTERY);

    if (raw == 0) /* no conversion has ended yet */
        return HAL_STALE;
    if (raw > BATTERY_MOST)
        raw = BATTERY_MOST;
    *out_mv = times(raw, BATTERY_WHOLE) + quotient(times(raw, BATTERY_OVER) >> 1, BATTERY_UNDER / 2);
    return HAL_OK;
}
