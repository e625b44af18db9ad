/* set.h: sets of sensor readings, put together from messages.
 *
 * A set is what one SYNC announces: every part whose status is ok, with the SYNC's sequence and the low byte of its time,
 * under one CRC. It counts as a whole or not at all. Parts and SYNC may come in any order, twice, damaged or not at all;
 * a set older than the newest one taken is refused. SET_STALE_MOST of those in a row are no latecomers: whoever sends them
 * has begun anew, and would be believed again once its clock has caught up. From then on every set is refused, until a new
 * session.
 */
#ifndef BRICKPILOT_HAL_LINK_SET_H
#define BRICKPILOT_HAL_LINK_SET_H

#include "hal.h"
#include "wire/codecs_gen.h"

enum { SET_PARTS = 6, SET_STALE_MOST = 8 };

/* All zero to begin with, and again for a new session. */
typedef struct {
    uint8_t parts[SET_PARTS][MESSAGE_DATA_MAX]; /* the newest of each kind */
    uint8_t have;                               /* bit per part */
    uint8_t sync[MESSAGE_DATA_MAX];
    bool announced; /* `sync` waits for its parts */

    /* The newest set taken. Values of a device hold where its status is HAL_OK. */
    bool any;
    uint32_t time_ms;
    uint8_t sequence;
    uint8_t stale_in_a_row; /* stays at SET_STALE_MOST until a new session */
    hal_status_t imu_status, rotation_status, battery_status, reference_status;
    hal_imu_t imu;
    hal_rotation_t rotation;
    uint16_t battery_mv;
    hal_reference_t reference;

    /* What was refused; stays at 65535. */
    uint16_t bad;        /* a check that failed, a size or status that does not exist */
    uint16_t incomplete; /* announced, and given up for a newer SYNC */
    uint16_t stale;      /* older than the newest set taken */
} set_t;

typedef enum {
    SET_OTHER = 0, /* not a message of a set */
    SET_MORE = 1,  /* nothing new is whole */
    SET_WHOLE = 2, /* a newer set is taken */
    SET_AGAIN = 3  /* the newest set once more, under another sequence: its answer was lost */
} set_status_t;

set_status_t set_take(set_t *set, const message_t *message);

/* Counts a message that the transport found damaged. */
void set_count_bad(set_t *set);

#endif
