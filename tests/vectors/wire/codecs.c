#include "wire/codecs_gen.h"

#include "vectors.h"

enum { OF_VECTOR = 3, SIZE = 8 };

/* A message that the brick reads: its fields out of eight drawn bytes. */
#define READ(name, FIELDS)                                                                                             \
    static void name(uint8_t *data)                                                                                    \
    {                                                                                                                  \
        struct wire_##name##_t value;                                                                                  \
        for (uint8_t i = 0; i < SIZE; i++)                                                                             \
            data[i] = (uint8_t)draw_s16();                                                                             \
        hash_u8((uint8_t)wire_##name##_unpack(&value, data, SIZE));                                                    \
        FIELDS(HASH)                                                                                                   \
    }
#define HASH(bits, field) hash_u##bits((uint##bits##_t)value.field);

/* One that it writes: eight bytes out of drawn fields. */
#define WRITTEN(name, FIELDS)                                                                                          \
    static void name(uint8_t *data)                                                                                    \
    {                                                                                                                  \
        struct wire_##name##_t value;                                                                                  \
        FIELDS(DRAW)                                                                                                   \
        hash_u8((uint8_t)wire_##name##_pack(data, &value, SIZE));                                                      \
        for (uint8_t i = 0; i < SIZE; i++)                                                                             \
            hash_u8(data[i]);                                                                                          \
    }
#define DRAW(bits, field) value.field = DRAW_##bits;
#define DRAW_8 (uint8_t) draw_s16()
#define DRAW_16 (uint16_t) draw_s16()
#define DRAW_32 (uint32_t) draw_s32()

#define IMU_FIELDS(X) X(16, accel_surge) X(16, accel_sway) X(16, yaw_rate) X(8, sequence) X(8, tick_ms)
#define ROTATION_FIELDS(X) X(16, left) X(16, right) X(8, sequence) X(8, tick_ms)
#define BATTERY_FIELDS(X) X(16, voltage) X(8, sequence) X(8, tick_ms)
#define REFERENCE_X_FIELDS(X) X(32, x) X(16, heading) X(8, sequence) X(8, tick_ms)
#define REFERENCE_Y_FIELDS(X) X(32, y) X(16, speed) X(8, sequence) X(8, tick_ms)
#define REFERENCE_TURN_FIELDS(X) X(16, yaw_rate) X(8, sequence) X(8, tick_ms)
#define SYNC_FIELDS(X) X(32, time) X(8, sequence) X(8, imu) X(8, rotation) X(8, battery) X(8, reference) X(16, check)
#define MOTORS_FIELDS(X) X(16, left) X(16, right) X(8, sequence) X(8, tick_ms) X(16, check)
#define FAULTS_FIELDS(X) X(16, bad) X(16, incomplete) X(16, stale) X(16, lost)

/* clang-format off: it takes these for one declaration */
READ(imu, IMU_FIELDS)
READ(rotation, ROTATION_FIELDS)
READ(battery, BATTERY_FIELDS)
READ(reference_x, REFERENCE_X_FIELDS)
READ(reference_y, REFERENCE_Y_FIELDS)
READ(reference_turn, REFERENCE_TURN_FIELDS)
READ(sync, SYNC_FIELDS)
WRITTEN(motors, MOTORS_FIELDS)
WRITTEN(faults, FAULTS_FIELDS)
/* clang-format on */

/* Three messages, all of them in turn. */
void vectors_feed(void)
{
    static void (*const messages[])(uint8_t * data) = {
        imu, rotation, battery, reference_x, reference_y, reference_turn, sync, motors, faults};
    enum { MESSAGES = sizeof messages / sizeof messages[0] };
    static uint8_t next;
    uint8_t data[SIZE];

    for (uint8_t i = 0; i < OF_VECTOR; i++) {
        messages[next](data);
        next = next + 1 < MESSAGES ? (uint8_t)(next + 1) : 0;
    }
}
