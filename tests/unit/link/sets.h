/* sets.h: messages of sensor sets, as a plant sends them. */
#ifndef BRICKPILOT_TESTS_SETS_H
#define BRICKPILOT_TESTS_SETS_H

#include "hal.h"
#include "wire/crc.h"
#include "wire/codecs_gen.h"

enum { SETS_MOST = 7 };

typedef struct {
    uint32_t time_ms;
    uint8_t sequence;
    hal_status_t imu_status, rotation_status, battery_status, reference_status;
    hal_imu_t imu;
    hal_rotation_t rotation;
    uint16_t battery_mv;
    hal_reference_t reference;
} sets_reading_t;

static inline void sets_close(const sets_reading_t *r, message_t *messages, int count)
{
    const struct wire_sync_t sync = {.time = r->time_ms,
                                     .sequence = r->sequence,
                                     .imu = (uint8_t)r->imu_status,
                                     .rotation = (uint8_t)r->rotation_status,
                                     .battery = (uint8_t)r->battery_status,
                                     .reference = (uint8_t)r->reference_status};
    message_t *last = &messages[count];
    uint16_t crc;

    *last = (message_t){.id = WIRE_SYNC_FRAME_ID, .size = 8};
    wire_sync_pack(last->data, &sync, 8);
    crc = crc_of_message(last);
    for (int i = 0; i < count; i++)
        crc = crc_of_bytes(crc, messages[i].data, 8);
    last->data[6] = (uint8_t)crc;
    last->data[7] = (uint8_t)(crc >> 8);
}

/* Fills `messages` with the parts that are ok, then the SYNC; returns how many. */
static inline int sets_pack(const sets_reading_t *r, message_t messages[SETS_MOST])
{
    const uint8_t tick = (uint8_t)r->time_ms;
    int count = 0;

    if (r->imu_status == HAL_OK) {
        const struct wire_imu_t imu = {.accel_surge = r->imu.accel_surge_mm_s2,
                                       .accel_sway = r->imu.accel_sway_mm_s2,
                                       .yaw_rate = r->imu.yaw_rate_mrad_s,
                                       .sequence = r->sequence,
                                       .tick_ms = tick};
        messages[count] = (message_t){.id = WIRE_IMU_FRAME_ID, .size = 8};
        wire_imu_pack(messages[count++].data, &imu, 8);
    }
    if (r->rotation_status == HAL_OK) {
        const struct wire_rotation_t rotation = {
            .left = r->rotation.left, .right = r->rotation.right, .sequence = r->sequence, .tick_ms = tick};
        messages[count] = (message_t){.id = WIRE_ROTATION_FRAME_ID, .size = 8};
        wire_rotation_pack(messages[count++].data, &rotation, 8);
    }
    if (r->battery_status == HAL_OK) {
        const struct wire_battery_t battery = {.voltage = r->battery_mv, .sequence = r->sequence, .tick_ms = tick};
        messages[count] = (message_t){.id = WIRE_BATTERY_FRAME_ID, .size = 8};
        wire_battery_pack(messages[count++].data, &battery, 8);
    }
    if (r->reference_status == HAL_OK) {
        const struct wire_reference_x_t x = {.x = r->reference.x_um,
                                             .heading = (int16_t)r->reference.heading_bam16,
                                             .sequence = r->sequence,
                                             .tick_ms = tick};
        const struct wire_reference_y_t y = {
            .y = r->reference.y_um, .speed = r->reference.speed_mm_s_q4, .sequence = r->sequence, .tick_ms = tick};
        const struct wire_reference_turn_t turn = {
            .yaw_rate = r->reference.yaw_rate_mrad_s, .sequence = r->sequence, .tick_ms = tick};
        for (int i = 0; i < 3; i++)
            messages[count + i] = (message_t){.id = (uint16_t)((int)WIRE_REFERENCE_X_FRAME_ID + i), .size = 8};
        wire_reference_x_pack(messages[count++].data, &x, 8);
        wire_reference_y_pack(messages[count++].data, &y, 8);
        wire_reference_turn_pack(messages[count++].data, &turn, 8);
    }
    sets_close(r, messages, count);
    return count + 1;
}

#endif
