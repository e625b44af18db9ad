#include "sil/sil.h"

#include <string.h>

static __thread sil_port_t *bound;

void sil_bind(sil_port_t *port)
{
    bound = port;
}

uint32_t hal_clock_ms(void)
{
    return bound->clock_ms;
}

hal_status_t hal_imu_read(hal_imu_t *out)
{
    if (bound->imu_status == HAL_OK)
        *out = bound->imu;
    else if (bound->imu_status == HAL_PARTLY)
        out->yaw_rate_mrad_s = bound->imu.yaw_rate_mrad_s;
    return bound->imu_status;
}

hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    if (bound->rotation_status == HAL_OK)
        *out = bound->rotation;
    return bound->rotation_status;
}

hal_status_t hal_reference_read(hal_reference_t *out)
{
    if (bound->reference_status == HAL_OK)
        *out = bound->reference;
    return bound->reference_status;
}

hal_status_t hal_battery_read(uint16_t *out_mv)
{
    if (bound->battery_status == HAL_OK)
        *out_mv = bound->battery_mv;
    return bound->battery_status;
}

void hal_motors_write(int16_t left_q15, int16_t right_q15)
{
    bound->left_q15 = left_q15;
    bound->right_q15 = right_q15;
    bound->motor_writes++;
}

bool hal_link_write(const message_t *message)
{
    if (bound->link_out_size == SIL_LINK_SIZE)
        return false;
    bound->link_out[bound->link_out_size++] = *message;
    return true;
}

bool hal_link_read(message_t *message)
{
    if (bound->link_in_size == 0)
        return false;
    *message = bound->link_in[0];
    bound->link_in_size--;
    (void)memmove(bound->link_in, bound->link_in + 1, bound->link_in_size * sizeof *bound->link_in);
    return true;
}
