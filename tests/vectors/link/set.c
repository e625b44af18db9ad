#include "link/set.h"

#include "core/bytes.h"
#include "vectors.h"
#include "wire/crc.h"

enum { MESSAGES = SET_PARTS + 1, SYNC_AT = SET_PARTS };

/* Bits of SYNC's signals in byte 5: two each. */
enum { IMU_SHIFT = 0, ROTATION_SHIFT = 2, BATTERY_SHIFT = 4, REFERENCE_SHIFT = 6 };

/* What a plant sends for one step, parts first. */
typedef struct {
    message_t messages[MESSAGES];
    bool there[MESSAGES];
    uint32_t time_ms;
    uint8_t sequence;
    uint8_t next;
} sent_t;

static uint8_t draw_status(void)
{
    return draw_rarely(5) ? 3 : draw_rarely(2) ? (uint8_t)draw_up_to(2) : 0;
}

static void draw_step(sent_t *sent)
{
    const uint8_t imu = draw_status(), rotation = draw_status(), battery = draw_status(), reference = draw_status();
    message_t *const sync = &sent->messages[SYNC_AT];
    uint32_t rest;
    uint16_t crc;

    if (!draw_rarely(3)) /* else the same step again, or one before it */
        sent->time_ms += (uint32_t)draw_up_to(20);
    else if (draw_rarely(3))
        sent->time_ms -= 3;
    rest = sent->time_ms;
    sent->sequence++;
    sent->there[0] = imu == 0;
    sent->there[1] = rotation == 0;
    sent->there[2] = battery == 0;
    sent->there[SYNC_AT] = true;
    sent->there[3] = sent->there[4] = sent->there[5] = reference == 0;
    for (uint8_t i = 0; i < SET_PARTS; i++) {
        message_t *const part = &sent->messages[i];
        part->id = (uint16_t)(WIRE_IMU_FRAME_ID + i);
        part->size = MESSAGE_DATA_MAX;
        for (uint8_t at = 0; at < 6; at++)
            part->data[at] = (uint8_t)draw_u16();
        part->data[6] = sent->sequence;
        part->data[7] = (uint8_t)sent->time_ms;
    }
    sync->id = WIRE_SYNC_FRAME_ID;
    sync->size = MESSAGE_DATA_MAX;
    for (uint8_t at = 0; at < 4; at++, rest >>= 8)
        sync->data[at] = (uint8_t)rest;
    sync->data[4] = sent->sequence;
    sync->data[5] = (uint8_t)((imu << IMU_SHIFT) | (rotation << ROTATION_SHIFT) | (battery << BATTERY_SHIFT) |
                              (reference << REFERENCE_SHIFT));
    crc = crc_of_message(sync);
    for (uint8_t i = 0; i < SET_PARTS; i++)
        if (sent->there[i])
            crc = crc_of_bytes(crc, sent->messages[i].data, MESSAGE_DATA_MAX);
    sync->data[6] = (uint8_t)crc;
    sync->data[7] = (uint8_t)(crc >> 8);
}

static void hash(const set_t *set)
{
    hash_u32(set->time_ms);
    hash_u8(set->sequence);
    hash_u8(set->stale_in_a_row);
    hash_u8((uint8_t)set->imu_status);
    hash_u8((uint8_t)set->rotation_status);
    hash_u8((uint8_t)set->battery_status);
    hash_u8((uint8_t)set->reference_status);
    hash_s16(set->imu.accel_surge_mm_s2);
    hash_s16(set->imu.accel_sway_mm_s2);
    hash_s16(set->imu.yaw_rate_mrad_s);
    hash_u16(set->rotation.left);
    hash_u16(set->rotation.right);
    hash_u16(set->battery_mv);
    hash_s32(set->reference.x_um);
    hash_s32(set->reference.y_um);
    hash_u16(set->reference.heading_bam16);
    hash_s16(set->reference.speed_mm_s_q4);
    hash_s16(set->reference.yaw_rate_mrad_s);
}

static message_t *next_of(sent_t *sent)
{
    for (;;) {
        if (sent->next == MESSAGES) {
            draw_step(sent);
            sent->next = 0;
        }
        if (sent->there[sent->next])
            return &sent->messages[sent->next];
        sent->next++;
    }
}

/* One message; some are lost, doubled or damaged. */
void vectors_feed(void)
{
    static set_t set;
    static sent_t sent = {.next = MESSAGES};
    message_t *const message = next_of(&sent);
    const uint16_t harm = draw_u16();
    set_status_t status;

    if ((harm & 0x0FU) == 0)
        message->data[(harm >> 4) & 7U] ^= (uint8_t)(harm >> 8);
    else if ((harm & 0xFFU) == 1)
        message->size = 7;
    status = set_take(&set, message);
    hash_u8((uint8_t)status);
    hash_u16(set.bad);
    hash_u16(set.incomplete);
    hash_u16(set.stale);
    if (status == SET_WHOLE || status == SET_AGAIN)
        hash(&set);
    sent.next = (uint8_t)(sent.next + ((harm & 0xF0U) == 0                              ? 0
                                       : (harm & 0xF0U) == 0x10U && sent.next < SYNC_AT ? 2
                                                                                        : 1));
    if (draw_rarely(10))
        bytes_clear(&set, sizeof set);
}
