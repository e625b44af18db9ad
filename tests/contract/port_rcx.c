/* port_rcx.c: the RCX's port on the simulator of its processor, beside brickOS's own kernel (tests/rcx/world.h). */
#include <stddef.h>

#include <dmotor.h>
#include <dsensor.h>

#include "../rcx/world.h"
#include "port.h"
#include "port_rcx.h"
#include "rcx/infrared.h"
#include "rcx/sensors.h"

enum { OPEN = 1023, RAW_MOST = 1023, PACKET_MOST = 16, SOURCE = 0x87 };

static bool began;
static uint8_t sent[PACKET_MOST]; /* the host's last packet */
static uint8_t sent_size;

void port_begin(void)
{
    message_t ignored;

    world_convert(0, 0);
    for (uint8_t input = 1; input <= 3; input++)
        world_convert(input, OPEN);
    if (!began) {
        sensors_start();
        began = infrared_start();
    }
    while (port_host_receive(&ignored)) {
    }
}
void port_end(void) {}

unsigned port_devices(void)
{
#ifdef RCX_ROTATION
    return PORT_GYRO | PORT_ROTATION | PORT_BATTERY;
#else
    return PORT_IMU | PORT_BATTERY;
#endif
}

/* An input that nothing is plugged into reads full scale; the battery is always there. */
unsigned port_tells(hal_status_t status)
{
    return status == HAL_STALE ? port_devices() & ~(unsigned)PORT_ROTATION : 0;
}

const char *port_why_not(hal_status_t status)
{
    if (status == HAL_ABSENT)
        return "an analogue sensor that is not plugged in is stale, not absent; the battery is always there";
#ifdef RCX_ROTATION
    return "a rotation sensor that is not plugged in looks like a wheel at rest";
#else
    return NULL;
#endif
}

/* The converter's reading of `value`: 512 plus or minus counts of per_count_q8 each, without multiplication. */
static uint16_t raw_of(int16_t value, uint16_t per_count_q8)
{
    const bool below = value < 0;
    const uint32_t size_q8 = (uint32_t)(uint16_t)(below ? -value : value) << 8;
    uint16_t counts = 0;

    for (uint32_t reached = per_count_q8; reached <= size_q8 && counts < 510; reached += per_count_q8)
        counts++;
    return below ? 512 - counts : 512 + counts;
}

static int16_t value_of(uint16_t raw, uint16_t per_count_q8)
{
    const uint16_t counts = raw < 512 ? 512 - raw : raw - 512;
    uint32_t value_q8 = 0;

    for (uint16_t i = 0; i < counts; i++)
        value_q8 += per_count_q8;
    return raw < 512 ? -(int16_t)(value_q8 >> 8) : (int16_t)(value_q8 >> 8);
}

enum { ACCEL_Q8 = 38 * 256 + 82, GYRO_Q8 = 20 * 256 + 115 };

/* brickOS's formula, raw times 43988 / 1560 mV: returns the largest raw up to `most_raw` that gives at most
 * `most_mv`. */
static uint16_t battery(uint16_t most_raw, uint16_t most_mv, uint16_t *mv)
{
    uint16_t raw = 0, next_mv = 0, over = 0;

    *mv = 0;
    while (raw < most_raw) {
        uint32_t scaled = over + 43988UL;
        for (; scaled >= 1560; scaled -= 1560)
            next_mv++;
        over = (uint16_t)scaled;
        if (next_mv > most_mv)
            break;
        *mv = next_mv;
        raw++;
    }
    return raw;
}

port_world_t port_resolved(const port_world_t *world)
{
    port_world_t resolved = *world;

    resolved.imu.accel_surge_mm_s2 = value_of(raw_of(world->imu.accel_surge_mm_s2, ACCEL_Q8), ACCEL_Q8);
    resolved.imu.accel_sway_mm_s2 = value_of(raw_of(world->imu.accel_sway_mm_s2, ACCEL_Q8), ACCEL_Q8);
    resolved.imu.yaw_rate_mrad_s = value_of(raw_of(world->imu.yaw_rate_mrad_s, GYRO_Q8), GYRO_Q8);
    (void)battery(RAW_MOST, world->battery_mv, &resolved.battery_mv);
    return resolved;
}

/* A duty has 256 pulses at most. */
int16_t port_resolved_duty(int16_t duty_q15)
{
    const uint16_t size = (uint16_t)(duty_q15 < 0 ? -duty_q15 : duty_q15);
    const uint16_t rounded = (size + 64U) & 0xFF80U;
    const int16_t whole = rounded > 32640U ? 32767 : (int16_t)rounded;

    return duty_q15 < 0 ? -whole : whole;
}

void port_step(uint32_t ms, unsigned working, unsigned silent, const port_world_t *world)
{
    uint16_t mv;

    (void)silent;
    world_convert(0, working & PORT_BATTERY ? battery(RAW_MOST, world->battery_mv, &mv) : 0);
    world_convert(2, working & (PORT_IMU | PORT_GYRO) ? raw_of(world->imu.yaw_rate_mrad_s, GYRO_Q8) : OPEN);
#ifdef RCX_ROTATION
    if (working & PORT_ROTATION) {
        ROTATION_1 = (int16_t)world->rotation.left;
        ROTATION_3 = (int16_t)world->rotation.right;
    }
#else
    world_convert(1, working & PORT_IMU ? raw_of(world->imu.accel_surge_mm_s2, ACCEL_Q8) : OPEN);
    world_convert(3, working & PORT_IMU ? raw_of(world->imu.accel_sway_mm_s2, ACCEL_Q8) : OPEN);
#endif
    world_run((uint16_t)ms);
}

static int16_t duty_of(int16_t pulses)
{
    return pulses >= 256 ? 32767 : pulses <= -256 ? -32767 : (int16_t)(pulses << 7);
}

void port_motors(int16_t *left_q15, int16_t *right_q15)
{
    int16_t a, c;

    world_pulses(&a, &c);
    *left_q15 = duty_of(a);
    *right_q15 = duty_of(c);
}

uint8_t port_room(void)
{
    return 1;
}

bool port_host_send(const message_t *message)
{
    static uint8_t sequence;
    uint8_t at = 0, sum = 0xFF;

    sent[at++] = 0xF1;
    sent[at++] = (uint8_t)(message->size + INFRARED_HEAD + 2);
    sent[at++] = INFRARED_PORT;
    sent[at++] = SOURCE;
    sent[at++] = sequence++;
    sent[at++] = (uint8_t)message->id;
    sent[at++] = (uint8_t)(message->id >> 8);
    for (uint8_t i = 0; i < message->size; i++)
        sent[at++] = message->data[i];
    for (uint8_t i = 0; i < at; i++)
        sum = (uint8_t)(sum + sent[i]);
    sent[at++] = sum;
    sent_size = at;
    world_send(sent, sent_size);
    return true;
}

void port_host_repeat(void)
{
    world_send(sent, sent_size);
}

bool port_host_receive(message_t *message)
{
    uint8_t packet[PACKET_MOST];
    const uint8_t size = world_receive(packet, sizeof packet);

    if (size < 5 + INFRARED_HEAD || packet[2] != INFRARED_HOST)
        return false;
    message->id = (uint16_t)(packet[5] | packet[6] << 8);
    message->size = (uint8_t)(size - 5 - INFRARED_HEAD);
    for (uint8_t i = 0; i < message->size; i++)
        message->data[i] = packet[4 + INFRARED_HEAD + i];
    return true;
}
