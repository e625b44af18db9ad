/* recorder.c: a separate program. It drives the manoeuvres below and stores the sensors' readings in the memory that
 * the autopilot would need. The link carries 218 bytes per second: too few to send the readings while driving.
 * Afterwards `brickpilot import rcx` fetches the recording, as a data set.
 *
 * The host asks for a block by number: two bytes, low byte first. The reply is the number and the block. Block 0 is the
 * description (describe()); block n holds the samples from 20 (n - 1) on. A repeated request gets the same reply.
 */
#include <conio.h>
#include <lnp.h>
#include <unistd.h>

#include "hal.h"
#include "rcx/board.h"
#include "rcx/infrared.h"
#include "rcx/sensors.h"

enum {
    VERSION = 1,
    PERIOD_MS = 10,
    SAMPLE_SIZE = 5, /* bytes: four numbers of 10 bits; the first one has the lowest bits */
    BLOCK_SAMPLES = 20,
    SAMPLES_MOST = 1700,
    HALF = 16384
};

/* A part of a manoeuvre: the duty of both motors, held for a number of samples. */
typedef struct {
    int16_t left_q15, right_q15;
    uint16_t samples;
} manoeuvre_t;

static const manoeuvre_t MANOEUVRES[] = {
    {0, 0, 100},        {HALF, HALF, 300}, {0, 0, 100},    {-HALF, -HALF, 300}, {0, 0, 100},
    {HALF, -HALF, 300}, {0, 0, 100},       {HALF, 0, 300}, {0, 0, 100},
};
enum { MANOEUVRES_COUNT = sizeof MANOEUVRES / sizeof MANOEUVRES[0] };

static uint8_t samples[SAMPLES_MOST * SAMPLE_SIZE];
static uint8_t *sample_end = samples;
static uint16_t sample_count, late;
static uint8_t block[2 + BLOCK_SAMPLES * SAMPLE_SIZE];
static volatile uint16_t asked;
static volatile bool asking;

/* Runs in the kernel's receiving interrupt. */
static void receive(const unsigned char *data, unsigned char size, unsigned char source)
{
    (void)source;
    if (size != 2)
        return;
    asked = (uint16_t)(data[0] | data[1] << 8);
    asking = true;
}

static void sample(void)
{
    const uint16_t gyro = BOARD_GYRO_INPUT >> 6;
    const uint16_t battery = BATTERY >> 6;
#ifdef RCX_ROTATION
    const uint16_t first = (uint16_t)BOARD_LEFT_COUNT & 1023U;
    const uint16_t second = (uint16_t)BOARD_RIGHT_COUNT & 1023U;
#else
    const uint16_t first = BOARD_SURGE_INPUT >> 6;
    const uint16_t second = BOARD_SWAY_INPUT >> 6;
#endif

    *sample_end++ = (uint8_t)first;
    *sample_end++ = (uint8_t)(first >> 8 | second << 2);
    *sample_end++ = (uint8_t)(second >> 6 | gyro << 4);
    *sample_end++ = (uint8_t)(gyro >> 4 | battery << 6);
    *sample_end++ = (uint8_t)(battery >> 2);
    sample_count++;
}

/* Drives one manoeuvre. False if the program has to end. */
static bool drive(const manoeuvre_t *manoeuvre, uint32_t *due_ms)
{
    hal_motors_write(manoeuvre->left_q15, manoeuvre->right_q15);
    for (uint16_t i = 0; i < manoeuvre->samples; i++) {
        int32_t left_ms;

        sample();
        *due_ms += PERIOD_MS;
        left_ms = (int32_t)(*due_ms - hal_clock_ms());
        if (left_ms > 0)
            (void)msleep((unsigned)left_ms);
        else
            late++;
        if (shutdown_requested())
            return false;
    }
    return true;
}

static uint8_t *put(uint8_t *at, uint16_t value)
{
    *at++ = (uint8_t)value;
    *at++ = (uint8_t)(value >> 8);
    return at;
}

static uint8_t *put_axis(uint8_t *at, const board_axis_t *axis)
{
    at = put(at, axis->zero_raw);
    *at++ = axis->per_count_256;
    *at++ = axis->per_count;
    *at++ = axis->reversed;
    return at;
}

/* Writes version, sensors (0: IMU, 1: rotation), period, samples, late samples, axes and manoeuvres. Returns the end. */
static uint8_t *describe(uint8_t *at)
{
    *at++ = VERSION;
#ifdef RCX_ROTATION
    *at++ = 1;
#else
    *at++ = 0;
#endif
    *at++ = PERIOD_MS;
    at = put(at, sample_count);
    at = put(at, late);
    at = put_axis(at, &BOARD_GYRO);
#ifdef RCX_ROTATION
    *at++ = BOARD_LEFT_REVERSED;
    *at++ = BOARD_RIGHT_REVERSED;
#else
    at = put_axis(at, &BOARD_SURGE);
    at = put_axis(at, &BOARD_SWAY);
#endif
    *at++ = MANOEUVRES_COUNT;
    for (uint8_t i = 0; i < MANOEUVRES_COUNT; i++) {
        at = put(at, (uint16_t)MANOEUVRES[i].left_q15);
        at = put(at, (uint16_t)MANOEUVRES[i].right_q15);
        at = put(at, MANOEUVRES[i].samples);
    }
    return at;
}

static void reply(uint16_t number)
{
    const uint8_t *from = samples;
    uint8_t *at = put(block, number);

    if (number == 0) {
        at = describe(at);
    } else {
        while (--number > 0 && from < sample_end)
            from += BLOCK_SAMPLES * SAMPLE_SIZE;
        for (uint8_t i = 0; i < BLOCK_SAMPLES * SAMPLE_SIZE && from < sample_end; i++)
            *at++ = *from++;
    }
    (void)lnp_addressing_write(block, (uint8_t)(at - block), INFRARED_HOST, INFRARED_PORT);
}

static wakeup_t host_asks(wakeup_t unused)
{
    (void)unused;
    return asking;
}

int main(int argc, char **argv)
{
    uint32_t due_ms;
    bool whole = true;

    (void)argc;
    (void)argv;
    sensors_start();
    cputs("rEc  ");
    due_ms = hal_clock_ms();
    for (uint8_t i = 0; i < MANOEUVRES_COUNT && whole; i++)
        whole = drive(&MANOEUVRES[i], &due_ms);
    hal_motors_write(0, 0);
    cputs("SEnd ");
    lnp_addressing_set_handler(INFRARED_PORT, &receive);
    while (whole && wait_event(&host_asks, 0) != 0) {
        asking = false;
        reply(asked);
    }
    lnp_addressing_set_handler(INFRARED_PORT, LNP_DUMMY_ADDRESSING);
    return 0;
}
