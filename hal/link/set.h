/* set.h: assembles sets of sensor readings from messages.
 *
 * A SYNC announces a set: every part whose status is ok. The parts have the SYNC's sequence number and the low byte of
 * the SYNC's time, and one CRC covers all parts. A set is taken as a whole or not at all. Parts and SYNC may come in
 * any order, twice, damaged or not at all. A set that is older than the newest set is refused. After SET_STALE_MOST
 * such sets in a row the sender must have restarted. Its sets would look valid again as soon as its clock has caught
 * up. So from then on every set is refused, until a new session begins.
 */
#ifndef BRICKPILOT_HAL_LINK_SET_H
#define BRICKPILOT_HAL_LINK_SET_H

#include "hal.h"
#include "wire/codecs_gen.h"

enum { SET_PARTS = 6, SET_STALE_MOST = 8 };

/* All fields are 0 at the start, and again for a new session. */
typedef struct {
    uint8_t parts[SET_PARTS][MESSAGE_DATA_MAX]; /* data of the newest part of each kind */
    uint8_t have;                               /* one bit for each part that has come */
    uint8_t sync[MESSAGE_DATA_MAX];
    bool announced; /* `sync` waits for its parts */

    /* The newest set. A device's values count only if its status is HAL_OK. */
    bool any;
    uint32_t time_ms;
    uint8_t sequence;
    uint8_t stale_in_a_row; /* stays at SET_STALE_MOST until a new session */
    hal_status_t imu_status, rotation_status, battery_status, reference_status;
    hal_imu_t imu;
    hal_rotation_t rotation;
    uint16_t battery_mv;
    hal_reference_t reference;

    /* Counts of messages and sets that were refused; each saturates at 65535. */
    uint16_t bad;        /* messages or sets with a wrong CRC, size or status */
    uint16_t incomplete; /* sets that were not complete when the next SYNC came */
    uint16_t stale;      /* sets that were older than the newest set */
} set_t;

typedef enum {
    SET_OTHER = 0, /* the message belongs to no set */
    SET_MORE = 1,  /* no new set is complete yet */
    SET_WHOLE = 2, /* a newer set is complete */
    SET_AGAIN = 3  /* the newest set came again with another sequence number: the reply to it was lost */
} set_status_t;

/* Takes a message. */
set_status_t set_take(set_t *set, const message_t *message);

/* Counts a message that the transport found damaged. */
void set_count_bad(set_t *set);

#endif
