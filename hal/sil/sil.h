/* sil.h: the HAL in process. Whoever owns the plant fills a mailbox and binds it; the controller's HAL calls read and
 * write it.
 *
 * The binding is per thread, so that many closed loops may run side by side.
 */
#ifndef BRICKPILOT_HAL_SIL_H
#define BRICKPILOT_HAL_SIL_H

#include "hal.h"

enum { SIL_LINK_SIZE = 16 };

typedef struct {
    uint32_t clock_ms;
    /* What the next read returns: the value, where its status is HAL_OK. */
    hal_status_t imu_status, rotation_status, reference_status, battery_status;
    hal_imu_t imu;
    hal_rotation_t rotation;
    hal_reference_t reference;
    uint16_t battery_mv;
    /* What the controller wrote last, and how often. */
    int16_t left_q15, right_q15;
    uint32_t motor_writes;
    /* Messages to and from the other end, oldest first. A write without room is refused, as on any link. */
    message_t link_out[SIL_LINK_SIZE], link_in[SIL_LINK_SIZE];
    uint16_t link_out_size, link_in_size;
} sil_port_t;

/* The port that this thread's HAL calls use from now on. The caller keeps it alive; NULL unbinds. */
void sil_bind(sil_port_t *port);

#endif
