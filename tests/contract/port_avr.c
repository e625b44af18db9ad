/* port_avr.c: the port to AVR chips, on simavr's chip with the world of tests/avr/world.c round it. */
#include "port_avr.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>

#include "avr/analogue.h"
#include "avr/board.h"
#include "avr/clock.h"
#include "avr/digital.h"
#include "avr/motors.h"
#include "avr/rotation.h"
#include "avr/serial.h"
#include "port.h"
#include "wire/frame.h"

enum { GYRO, SURGE, SWAY, BATTERY };
enum { OPEN = 1023, RAW_LEAST = 1, RAW_MOST = 1022 };

/* Ranges of sim_host/models/rcx.toml, in mrad/s, mm/s^2 and mV: 2.5 V are 10.47 rad/s and 19.62 m/s^2. */
enum { GYRO_RANGE = 10470, ACCEL_RANGE = 19620, BATTERY_RANGE = 20000 };

volatile mailbox_t mailbox;

static frame_decoder_t host; /* the host's decoder of the bytes that the chip sends */
static bool began;

void port_ask(uint8_t request)
{
    GPIOR1 = request;
}

void port_begin(void)
{
    message_t message;

    if (!began) {
        motors_start();
        clock_start();
        analogue_start();
        digital_start();
        rotation_start();
        serial_start();
        sei();
    }
    began = true;
    while (port_host_receive(&message)) {
    }
}

void port_end(void) {}

unsigned port_devices(void)
{
    return PORT_BATTERY |
#ifdef AVR_ACCELEROMETER
           PORT_IMU |
#else
           PORT_GYRO |
#endif
#ifdef AVR_ROTATION
           PORT_ROTATION;
#else
           0;
#endif
}

unsigned port_tells(hal_status_t status)
{
    return status == HAL_STALE ? port_devices() & ~(unsigned)PORT_ROTATION : 0;
}

const char *port_why_not(hal_status_t status)
{
    if (status == HAL_ABSENT)
        return "unplugged is stale";
    return (port_devices() & PORT_ROTATION) != 0 ? "no edges: a wheel at rest" : NULL;
}

static uint16_t raw_of(int16_t value, int16_t range)
{
    const int32_t twice = (int32_t)value * 1024 / range; /* in half counts */
    const int32_t raw = 512 + (twice >= 0 ? (twice + 1) / 2 : (twice - 1) / 2);

    return (uint16_t)(raw < RAW_LEAST ? RAW_LEAST : raw > RAW_MOST ? RAW_MOST : raw);
}

#if BOARD_IMU != BOARD_ANALOGUE
/* A count of these chips is less than 1 mrad/s or 1 mm/s^2, so that only their ranges matter: 32,767 counts one way,
 * 32,768 the other. Up and left are their positive directions. */
#if BOARD_IMU == BOARD_MPU6050
enum { DIGITAL_RATE = 17436, DIGITAL_RATE_NEG = 17437, DIGITAL_FORCE = 19613, DIGITAL_FORCE_NEG = 19614 };
#else
enum { DIGITAL_RATE = 20016, DIGITAL_RATE_NEG = 20017, DIGITAL_FORCE = 19601, DIGITAL_FORCE_NEG = 19602 };
#endif

static int16_t digital(int16_t value, int16_t most, int16_t least)
{
    return value > most ? most : value < -least ? (int16_t)-least : value;
}
#else
/* A value after a converter of 10 bits, rounded to the nearest. */
static int16_t resolved(int16_t value, int16_t range)
{
    const int32_t q9 = ((int32_t)raw_of(value, range) - 512) * range;

    return (int16_t)(q9 >= 0 ? (q9 + 256) / 512 : (q9 - 256) / 512);
}
#endif

static uint16_t battery_raw(uint16_t mv)
{
    const uint32_t raw = (uint32_t)mv * 1024 / BATTERY_RANGE;

    return (uint16_t)(raw > 1023 ? 1023 : raw);
}

port_world_t port_resolved(const port_world_t *world)
{
    port_world_t seen = *world;

#if BOARD_IMU == BOARD_ANALOGUE
    seen.imu.yaw_rate_mrad_s = resolved(world->imu.yaw_rate_mrad_s, GYRO_RANGE);
    seen.imu.accel_surge_mm_s2 = resolved(world->imu.accel_surge_mm_s2, ACCEL_RANGE);
    seen.imu.accel_sway_mm_s2 = resolved(world->imu.accel_sway_mm_s2, ACCEL_RANGE);
#else
    seen.imu.yaw_rate_mrad_s = digital(world->imu.yaw_rate_mrad_s, DIGITAL_RATE_NEG, DIGITAL_RATE);
    seen.imu.accel_surge_mm_s2 = digital(world->imu.accel_surge_mm_s2, DIGITAL_FORCE, DIGITAL_FORCE_NEG);
    seen.imu.accel_sway_mm_s2 = digital(world->imu.accel_sway_mm_s2, DIGITAL_FORCE_NEG, DIGITAL_FORCE);
#endif
    seen.battery_mv = (uint16_t)((uint32_t)battery_raw(world->battery_mv) * BATTERY_RANGE / 1024);
    return seen;
}

/* The drive's duty has 1024 steps. */
int16_t port_resolved_duty(int16_t duty_q15)
{
    const int32_t parts = ((duty_q15 < 0 ? -(int32_t)duty_q15 : duty_q15) + 16) / 32;
    const int32_t size = parts * 32 > 32767 ? 32767 : parts * 32;

    return (int16_t)(duty_q15 < 0 ? -size : size);
}

static bool put(volatile uint16_t *to, uint16_t value)
{
    const bool other = *to != value;

    *to = value;
    return other;
}

static void wait_ms(uint8_t ms)
{
    const uint32_t began_ms = hal_clock_ms();

    while (hal_clock_ms() - began_ms < ms) {
    }
}

/* A change of the world may come in the middle of a burst, so this time includes the next burst. A digital IMU may have
 * to be set up again. */
#if BOARD_IMU == BOARD_ANALOGUE
enum { SETTLES_MS = 2 * BOARD_TICK_MS };
#else
enum { SETTLES_MS = 150 };
#endif

void port_step(uint32_t ms, unsigned working, unsigned silent, const port_world_t *world)
{
    const bool imu = (working & (PORT_IMU | PORT_GYRO)) != 0;
    bool other = put((volatile uint16_t *)&mailbox.motion[0], (uint16_t)world->imu.yaw_rate_mrad_s);

    other |= put((volatile uint16_t *)&mailbox.motion[1], (uint16_t)world->imu.accel_surge_mm_s2);
    other |= put((volatile uint16_t *)&mailbox.motion[2], (uint16_t)world->imu.accel_sway_mm_s2);
    mailbox.imu_unpowered = !imu;
    other |= put(&mailbox.raw[GYRO], imu ? raw_of(world->imu.yaw_rate_mrad_s, GYRO_RANGE) : OPEN);

    (void)silent;
    other |= put(&mailbox.raw[SURGE], imu ? raw_of(world->imu.accel_surge_mm_s2, ACCEL_RANGE) : OPEN);
    other |= put(&mailbox.raw[SWAY], imu ? raw_of(world->imu.accel_sway_mm_s2, ACCEL_RANGE) : OPEN);
    other |= put(&mailbox.raw[BATTERY], working & PORT_BATTERY ? battery_raw(world->battery_mv) : 0);
    other |= put(&mailbox.counts[0], world->rotation.left);
    other |= put(&mailbox.counts[1], world->rotation.right);
    port_ask(WORLD_SHOW);
    if (other) {
        wait_ms(SETTLES_MS);
        (void)clock_wait();
    }
    for (uint32_t passed = 0; passed < ms; passed += BOARD_TICK_MS)
        (void)clock_wait();
}

static int16_t q15_of(int16_t parts)
{
    return parts >= 1024 ? 32767 : parts <= -1024 ? -32767 : (int16_t)(parts * 32);
}

/* A new duty is in force from the PWM's next period on. */
void port_motors(int16_t *left_q15, int16_t *right_q15)
{
    wait_ms(2);
    port_ask(WORLD_MEASURE);
    wait_ms(6);
    *left_q15 = q15_of(mailbox.parts[0]);
    *right_q15 = q15_of(mailbox.parts[1]);
}

uint8_t port_room(void)
{
    return SERIAL_IN / FRAME_SIZE_MAX;
}

void port_host_bytes(const uint8_t *bytes, uint8_t size)
{
    for (uint8_t i = 0; i < size; i++)
        mailbox.bytes[i] = bytes[i];
    mailbox.size = size;
    port_ask(WORLD_SEND);
    wait_ms(3); /* a frame takes 1.3 ms */
}

bool port_host_send(const message_t *message)
{
    uint8_t bytes[FRAME_SIZE_MAX];

    port_host_bytes(bytes, frame_encode(message, bytes));
    return true;
}

/* Two whole ms without a byte are the end. It waits for three, because the first has already begun. */
bool port_host_receive(message_t *message)
{
    for (uint8_t silent_ms = 0; silent_ms < 3;) {
        mailbox.size = 1;
        port_ask(WORLD_RECEIVE);
        if (mailbox.size == 0) {
            silent_ms++;
            wait_ms(1);
        } else {
            silent_ms = 0;
            if (frame_take(&host, mailbox.bytes[0], message) == FRAME_MESSAGE)
                return true;
        }
    }
    return false;
}
