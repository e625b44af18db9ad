#include "rcx/sensors.h"

#include "hal.h"
#include "rcx/board.h"

enum { RAW_BITS_BELOW = 6, RAW_MAX = 1023 };

/* mV of one count of the battery's converter, 43988 / 1560, as a whole and a fraction: brickOS's own formula. */
enum { BATTERY_WHOLE = 28, BATTERY_OVER = 77, BATTERY_UNDER = 390 };

void sensors_start(void)
{
#ifdef RCX_ROTATION
    ds_activation = BOARD_COUNTING_INPUTS;
    ds_rotation_set(&BOARD_LEFT_INPUT, 0);
    ds_rotation_set(&BOARD_RIGHT_INPUT, 0);
    ds_rotation = BOARD_COUNTING_INPUTS;
#endif
    /* An input that is not active is passive: so the kernel leaves all of them to a program that starts. */
}

static uint16_t raw_of(uint16_t converter)
{
    return converter >> RAW_BITS_BELOW;
}

static bool connected(uint16_t raw)
{
    return raw > 0 && raw < RAW_MAX;
}

/* In products of 8 bits, which the processor has. */
static int16_t scaled(const board_axis_t *axis, uint16_t raw)
{
    const bool below = raw < axis->zero_raw;
    const uint16_t counts = below ? axis->zero_raw - raw : raw - axis->zero_raw;
    const uint8_t low = (uint8_t)counts;
    const uint8_t high = (uint8_t)(counts >> 8);
    const int16_t size = (int16_t)(((uint16_t)(high * axis->per_count) << 8) + low * axis->per_count +
                                   high * axis->per_count_256 + ((uint16_t)(low * axis->per_count_256) >> 8));

    return below != axis->reversed ? -size : size;
}

hal_status_t hal_imu_read(hal_imu_t *out)
{
    const uint16_t gyro = raw_of(BOARD_GYRO_INPUT);
#ifdef RCX_ROTATION
    if (!connected(gyro))
        return HAL_STALE;
    out->yaw_rate_mrad_s = scaled(&BOARD_GYRO, gyro);
    return HAL_PARTLY;
#else
    const uint16_t surge = raw_of(BOARD_SURGE_INPUT);
    const uint16_t sway = raw_of(BOARD_SWAY_INPUT);

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

/* A sensor that is not plugged in counts nothing: that cannot be told from a wheel at rest. */
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

/* The voltage moves by a few counts from step to step: it is followed count by count, since a product of 32 bits and a division
 * in every step would cost more than all other drivers. */
hal_status_t hal_battery_read(uint16_t *out_mv)
{
    static uint16_t followed_raw, followed_mv, over;
    const uint16_t raw = raw_of(BATTERY);

    if (raw == 0) /* not converted yet */
        return HAL_STALE;
    for (; followed_raw < raw; followed_raw++) {
        followed_mv += BATTERY_WHOLE;
        over += BATTERY_OVER;
        if (over >= BATTERY_UNDER) {
            over -= BATTERY_UNDER;
            followed_mv++;
        }
    }
    for (; followed_raw > raw; followed_raw--) {
        followed_mv -= BATTERY_WHOLE;
        if (over < BATTERY_OVER) {
            over += BATTERY_UNDER;
            followed_mv--;
        }
        over -= BATTERY_OVER;
    }
    *out_mv = followed_mv > 20000 ? 20000 : followed_mv;
    return HAL_OK;
}
