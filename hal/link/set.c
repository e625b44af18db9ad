#include "link/set.h"

#include "wire/crc.h"

enum { FIRST_PART = WIRE_IMU_FRAME_ID, SEQUENCE_AT = 6, TICK_AT = 7, UNCHECKED = 6 };

static uint16_t count(uint16_t before)
{
    return before < 65535U ? (uint16_t)(before + 1U) : before;
}

void set_count_bad(set_t *set)
{
    set->bad = count(set->bad);
}

static void keep(uint8_t *to, const uint8_t *from)
{
    for (uint8_t i = 0; i < MESSAGE_DATA_MAX; i++)
        to[i] = from[i];
}

/* Returns one bit for each part that the SYNC announces. */
static uint8_t announced_parts(const struct wire_sync_t *sync)
{
    return (uint8_t)((sync->imu == HAL_OK ? 1U : 0U) | (sync->rotation == HAL_OK ? 2U : 0U) |
                     (sync->battery == HAL_OK ? 4U : 0U) | (sync->reference == HAL_OK ? 0x38U : 0U));
}

static bool all_there(const set_t *set, uint8_t wanted, const struct wire_sync_t *sync)
{
    uint8_t bit = 1;

    if ((set->have & wanted) != wanted)
        return false;
    for (uint8_t i = 0; i < SET_PARTS; i++, bit = (uint8_t)(bit << 1))
        if ((wanted & bit) != 0 &&
            (set->parts[i][SEQUENCE_AT] != sync->sequence || set->parts[i][TICK_AT] != (uint8_t)sync->time))
            return false;
    return true;
}

static bool crc_of_set_holds(const set_t *set, uint8_t wanted, uint16_t announced)
{
    uint8_t id[2];
    uint8_t bit = 1;
    uint16_t crc;

    id[0] = (uint8_t)WIRE_SYNC_FRAME_ID;
    id[1] = (uint8_t)((uint16_t)WIRE_SYNC_FRAME_ID >> 8);
    crc = crc_of_bytes(crc_of_bytes(CRC_START, id, 2), set->sync, UNCHECKED);
    for (uint8_t i = 0; i < SET_PARTS; i++, bit = (uint8_t)(bit << 1))
        if ((wanted & bit) != 0)
            crc = crc_of_bytes(crc, set->parts[i], MESSAGE_DATA_MAX);
    return crc == announced;
}

static void read_imu(set_t *set)
{
    struct wire_imu_t imu;
    (void)wire_imu_unpack(&imu, set->parts[0], MESSAGE_DATA_MAX);
    set->imu.accel_surge_mm_s2 = imu.accel_surge;
    set->imu.accel_sway_mm_s2 = imu.accel_sway;
    set->imu.yaw_rate_mrad_s = imu.yaw_rate;
}

static void read_wheels_and_battery(set_t *set)
{
    struct wire_rotation_t rotation;
    struct wire_battery_t battery;
    (void)wire_rotation_unpack(&rotation, set->parts[1], MESSAGE_DATA_MAX);
    (void)wire_battery_unpack(&battery, set->parts[2], MESSAGE_DATA_MAX);
    set->rotation.left = rotation.left;
    set->rotation.right = rotation.right;
    set->battery_mv = battery.voltage;
}

static void read_reference(set_t *set)
{
    struct wire_reference_x_t x;
    struct wire_reference_y_t y;
    struct wire_reference_turn_t turn;
    (void)wire_reference_x_unpack(&x, set->parts[3], MESSAGE_DATA_MAX);
    (void)wire_reference_y_unpack(&y, set->parts[4], MESSAGE_DATA_MAX);
    (void)wire_reference_turn_unpack(&turn, set->parts[5], MESSAGE_DATA_MAX);
    set->reference.x_um = x.x;
    set->reference.y_um = y.y;
    set->reference.heading_bam16 = (uint16_t)x.heading;
    set->reference.speed_mm_s_q4 = y.speed;
    set->reference.yaw_rate_mrad_s = turn.yaw_rate;
}

static void accept(set_t *set, const struct wire_sync_t *sync)
{
    set->any = true;
    set->time_ms = sync->time;
    set->imu_status = (hal_status_t)sync->imu;
    set->rotation_status = (hal_status_t)sync->rotation;
    set->battery_status = (hal_status_t)sync->battery;
    set->reference_status = (hal_status_t)sync->reference;
    read_imu(set);
    read_wheels_and_battery(set);
    read_reference(set);
}

/* Takes the set that the stored SYNC announces, if all parts of the set are there. */
static set_status_t settle(set_t *set)
{
    struct wire_sync_t sync;
    uint8_t wanted;

    (void)wire_sync_unpack(&sync, set->sync, MESSAGE_DATA_MAX);
    wanted = announced_parts(&sync);
    if (!all_there(set, wanted, &sync))
        return SET_MORE;
    set->announced = false;
    set->have = 0;
    if (!crc_of_set_holds(set, wanted, sync.check) || sync.imu > HAL_STALE || sync.rotation > HAL_STALE ||
        sync.battery > HAL_STALE || sync.reference > HAL_STALE) {
        set_count_bad(set);
        return SET_MORE;
    }
    if (set->stale_in_a_row == SET_STALE_MOST || (set->any && (int32_t)(sync.time - set->time_ms) < 0)) {
        set->stale = count(set->stale);
        if (set->stale_in_a_row < SET_STALE_MOST)
            set->stale_in_a_row++;
        return SET_MORE;
    }
    set->stale_in_a_row = 0;
    if (set->any && sync.time == set->time_ms) {
        set->sequence = sync.sequence;
        return SET_AGAIN;
    }
    set->sequence = sync.sequence;
    accept(set, &sync);
    return SET_WHOLE;
}

set_status_t set_take(set_t *set, const message_t *message)
{
    const bool part = message->id >= FIRST_PART && message->id < FIRST_PART + SET_PARTS;

    if (!part && message->id != WIRE_SYNC_FRAME_ID)
        return SET_OTHER;
    if (message->size != MESSAGE_DATA_MAX) {
        set_count_bad(set);
        return SET_MORE;
    }
    if (part) {
        const uint8_t index = (uint8_t)(message->id - FIRST_PART);
        keep(set->parts[index], message->data);
        set->have = (uint8_t)(set->have | (uint8_t)(1U << index));
    } else {
        if (set->announced)
            set->incomplete = count(set->incomplete);
        keep(set->sync, message->data);
        set->announced = true;
    }
    return set->announced ? settle(set) : SET_MORE;
}
