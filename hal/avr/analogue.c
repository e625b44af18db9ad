#include "avr/analogue.h"

#include <avr/interrupt.h>
#include <stdbool.h>
#include <util/atomic.h>

#include "avr/board.h"
#include "hal.h"

/* The converter's clock is 125 kHz: up to 200 kHz it gives 10 good bits. A conversion takes 13 of its cycles, a start
 * 1. */
enum { CONTROL = 1U << ADEN | 1U << ADIE | 1U << ADPS2 | 1U << ADPS1 | 1U << ADPS0, BEGIN = 1U << ADSC };
enum { AVCC = 1U << REFS0 };
#ifdef BOARD_ATMEGA2560
enum { BANDGAP_INPUT = 0x1E };
#else
enum { BANDGAP_INPUT = 0x0E };
#endif

/* A round reads each sensor in turn. A burst has 4 rounds and two readings of the bandgap; the first of these two is
 * not used, since the input still settles. */
enum { ROUNDS = 4, COUNT_MOST = 1023, FRESH_TICKS = 1 };
#if BOARD_IMU != BOARD_ANALOGUE
#define ROUND ANALOGUE_BATTERY
enum { BATTERY_READINGS = ROUNDS };
#elif defined(AVR_ACCELEROMETER)
#define ROUND ANALOGUE_GYRO, ANALOGUE_SURGE, ANALOGUE_GYRO, ANALOGUE_SWAY, ANALOGUE_BATTERY
enum { GYRO_READINGS = 2 * ROUNDS, ACCEL_READINGS = ROUNDS, BATTERY_READINGS = ROUNDS };
#else
#define ROUND ANALOGUE_GYRO, ANALOGUE_GYRO, ANALOGUE_GYRO, ANALOGUE_GYRO, ANALOGUE_BATTERY
enum { GYRO_READINGS = 4 * ROUNDS, BATTERY_READINGS = ROUNDS };
#endif
static const __flash uint8_t ORDER[] = {ROUND, ROUND, ROUND, ROUND, ANALOGUE_BANDGAP, ANALOGUE_BANDGAP};
enum { READINGS = sizeof ORDER, LAST = READINGS - 1 };

static const __flash uint8_t INPUTS[ANALOGUE_SUMS] = {
#if BOARD_IMU == BOARD_ANALOGUE
    [ANALOGUE_GYRO] = AVCC | BOARD_GYRO_INPUT,
#ifdef AVR_ACCELEROMETER
    [ANALOGUE_SURGE] = AVCC | BOARD_SURGE_INPUT,     [ANALOGUE_SWAY] = AVCC | BOARD_SWAY_INPUT,
#endif
#endif
    [ANALOGUE_BATTERY] = AVCC | BOARD_BATTERY_INPUT, [ANALOGUE_BANDGAP] = AVCC | BANDGAP_INPUT,
};

/* The bandgap of 1.1 V reads as 225 with a reference of 5 V; both voltages may be wrong by a tenth. */
enum { BANDGAP_LEAST = 184, BANDGAP_MOST = 276 };

static uint16_t sums[ANALOGUE_SUMS]; /* sums of the present burst */
static uint8_t at;                   /* conversions of this burst that have ended */
static volatile uint16_t newest[ANALOGUE_BATTERY + 1];
static volatile uint8_t age = 255; /* ticks since the newest good burst ended; saturates at 255 */
static volatile uint16_t faults;

static void count_fault(void)
{
    if (faults < 65535U)
        faults++;
}

static void end_burst(uint16_t bandgap)
{
    if (bandgap < BANDGAP_LEAST || bandgap > BANDGAP_MOST) {
        count_fault();
        return;
    }
    for (uint8_t i = 0; i <= ANALOGUE_BATTERY; i++)
        newest[i] = sums[i];
    age = 0;
}

ISR(ADC_vect)
{
    const uint16_t reading = ADC;

    if (at >= LAST) {
        if (at == LAST)
            end_burst(reading);
        at = READINGS;
        return;
    }
    sums[ORDER[at]] += reading;
    at++;
    ADMUX = INPUTS[ORDER[at]];
    ADCSRA = CONTROL | BEGIN;
}

void analogue_start(void)
{
    ADMUX = INPUTS[ORDER[0]];
    ADCSRA = CONTROL;
    DIDR0 = 1U << BOARD_BATTERY_INPUT;
#if BOARD_IMU == BOARD_ANALOGUE
    DIDR0 |= 1U << BOARD_GYRO_INPUT | 1U << BOARD_SURGE_INPUT | 1U << BOARD_SWAY_INPUT;
#endif
    at = READINGS;
}

void analogue_begin(void)
{
    if (age < 255)
        age++;
    if (at != READINGS) {
        count_fault();
        ADCSRA = 1U << ADIF; /* ends a conversion that hangs, and drops a result that would count in the new burst */
    }
    for (uint8_t i = 0; i < ANALOGUE_SUMS; i++)
        sums[i] = 0;
    at = 0;
    ADMUX = INPUTS[ORDER[0]];
    ADCSRA = CONTROL | BEGIN;
}

uint16_t analogue_faults(void)
{
    uint16_t counted;

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        counted = faults;
    }
    return counted;
}

/* Gives the newest sum. Returns false if it is stale. */
static bool read(uint8_t which, uint16_t *sum)
{
    bool fresh;

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        fresh = age <= FRESH_TICKS;
        *sum = newest[which];
    }
    return fresh;
}

#define LOG2(readings) ((readings) == 16 ? 4U : (readings) == 8 ? 3U : 2U)

#if BOARD_IMU == BOARD_ANALOGUE
/* An input whose readings all lie at one end of the range is not connected. The value of an axis fits into 16 bits over
 * the whole range: see the checks below. */
#define IS_CONNECTED(sum, readings) ((sum) > 0 && (sum) < (readings) * (uint16_t)COUNT_MOST)

static int16_t scaled(uint16_t sum, uint8_t readings_log2, uint16_t zero, uint16_t per_count_q8, bool reversed)
{
    const int16_t counts = (int16_t)(sum - (zero << readings_log2));
    const uint16_t size = counts < 0 ? (uint16_t)-counts : (uint16_t)counts;
    const uint8_t shift = (uint8_t)(8 + readings_log2);
    const int16_t value = (int16_t)(((uint32_t)size * per_count_q8 + (1UL << (shift - 1))) >> shift);

    return (counts < 0) != reversed ? (int16_t)-value : value;
}

#define SCALED(sum, readings, axis)                                                                                    \
    scaled((sum), LOG2(readings), BOARD_##axis##_ZERO, BOARD_##axis##_PER_COUNT_Q8, BOARD_##axis##_REVERSED)
#define FITS(axis)                                                                                                     \
    _Static_assert((BOARD_##axis##_ZERO > 511 ? BOARD_##axis##_ZERO : COUNT_MOST - BOARD_##axis##_ZERO) *              \
                           (uint32_t)BOARD_##axis##_PER_COUNT_Q8 <=                                                    \
                       32767UL * 256,                                                                                  \
                   "the whole range of an axis must fit into 16 bits")

FITS(GYRO);
#ifdef AVR_ACCELEROMETER
FITS(SURGE);
FITS(SWAY);
#endif

hal_status_t hal_imu_read(hal_imu_t *out)
{
    uint16_t gyro;
#ifdef AVR_ACCELEROMETER
    uint16_t surge, sway;
#endif

    if (!read(ANALOGUE_GYRO, &gyro) || !IS_CONNECTED(gyro, GYRO_READINGS))
        return HAL_STALE;
    out->yaw_rate_mrad_s = SCALED(gyro, GYRO_READINGS, GYRO);
#ifdef AVR_ACCELEROMETER
    if (read(ANALOGUE_SURGE, &surge) && read(ANALOGUE_SWAY, &sway) && IS_CONNECTED(surge, ACCEL_READINGS) &&
        IS_CONNECTED(sway, ACCEL_READINGS)) {
        out->accel_surge_mm_s2 = SCALED(surge, ACCEL_READINGS, SURGE);
        out->accel_sway_mm_s2 = SCALED(sway, ACCEL_READINGS, SWAY);
        return HAL_OK;
    }
#endif
    return HAL_PARTLY;
}
#endif

hal_status_t hal_battery_read(uint16_t *out_mv)
{
    uint16_t sum;

    if (!read(ANALOGUE_BATTERY, &sum) || sum == 0)
        return HAL_STALE;
    *out_mv = (uint16_t)((uint32_t)sum * BOARD_BATTERY_FULL_MV >> (10 + LOG2(BATTERY_READINGS)));
    return HAL_OK;
}

/* No device on the robot measures its true state. */
hal_status_t hal_reference_read(hal_reference_t *out)
{
    (void)out;
    return HAL_ABSENT;
}
