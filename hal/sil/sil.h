/* sil.h: the HAL port inside one process. The owner of the plant fills a mailbox and binds it; the controller's calls
 * of the HAL read and write this mailbox.
 *
 * The binding is per thread, so that many closed loops can run side by side.
 */
#ifndef BRICKPILOT_HAL_SIL_H
#define BRICKPILOT_HAL_SIL_H

#include "hal.h"

enum { SIL_LINK_SIZE = 16 };

typedef struct {
    uint32_t clock_ms;
    /* What the next read returns. A value is valid only if its status is HAL_OK; the yaw rate also with HAL_PARTLY. */
    hal_status_t imu_status, rotation_status, reference_status, battery_status;
    hal_imu_t imu;
    hal_rotation_t rotation;
    hal_reference_t reference;
    uint16_t battery_mv;
    /* The last duties that the controller wrote, and how many times it wrote. */
    int16_t left_q15, right_q15;
    uint32_t motor_writes;
    /* Messages to and from the other end, oldest first. A write is refused if there is no room, as on any link. */
    message_t link_out[SIL_LINK_SIZE], link_in[SIL_LINK_SIZE];
    uint16_t link_out_size, link_in_size;
} sil_port_t;

/* From now on this thread's calls of the HAL use `port`, which must outlive its use. NULL: no port. */
void sil_bind(sil_port_t *port);

#endif
