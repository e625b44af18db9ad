#include "link/link.h"

#include "wire/crc.h"

#ifdef __H8300__
#define LINK_THREAD /* the H8/300 has no threads */
#else
#define LINK_THREAD __thread
#endif

static LINK_THREAD link_port_t *bound;

void link_bind(link_port_t *port)
{
    bound = port;
}

static void send(link_port_t *port, const message_t *message)
{
    if (port->out_size < LINK_OUT)
        port->out[(port->out_first + port->out_size++) % LINK_OUT] = *message;
    else if (port->lost < 65535U)
        port->lost++;
}

bool link_give(link_port_t *port, message_t *message)
{
    if (port->out_size == 0)
        return false;
    *message = port->out[port->out_first];
    port->out_first = (uint8_t)((port->out_first + 1U) % LINK_OUT);
    port->out_size--;
    return true;
}

static void send_motors(link_port_t *port)
{
    const struct wire_motors_t motors = {.left = port->left_q15,
                                         .right = port->right_q15,
                                         .sequence = port->set.sequence,
                                         .tick_ms = (uint8_t)port->set.time_ms};
    message_t message = {.id = WIRE_MOTORS_FRAME_ID, .size = WIRE_MOTORS_LENGTH};

    (void)wire_motors_pack(message.data, &motors, sizeof message.data);
    crc_seal(&message);
    send(port, &message);
}

static void send_faults(link_port_t *port)
{
    const struct wire_faults_t faults = {
        .bad = port->set.bad, .incomplete = port->set.incomplete, .stale = port->set.stale, .lost = port->lost};
    message_t message = {.id = WIRE_FAULTS_FRAME_ID, .size = WIRE_FAULTS_LENGTH};

    (void)wire_faults_pack(message.data, &faults, sizeof message.data);
    send(port, &message);
}

static void begin_session(link_port_t *port)
{
    port->set = (set_t){.any = false};
    port->fresh = false;
    port->lost = 0;
}

void link_count_bad(link_port_t *port)
{
    set_count_bad(&port->set);
}

link_event_t link_take(link_port_t *port, const message_t *message)
{
    switch (set_take(&port->set, message)) {
    case SET_WHOLE:
        port->fresh = true;
        port->clock_ms = port->set.time_ms;
        return LINK_STEP;
    case SET_AGAIN:
        send_motors(port);
        return LINK_NOTHING;
    case SET_MORE:
        return LINK_NOTHING;
    case SET_OTHER:
        break;
    }
    if (message->id == WIRE_OPEN_FRAME_ID && crc_holds(message))
        begin_session(port);
    if (port->in_size == LINK_IN)
        return LINK_MESSAGE;
    port->in[(port->in_first + port->in_size++) % LINK_IN] = *message;
    return LINK_MESSAGE;
}

void link_stepped(link_port_t *port)
{
    port->fresh = false;
}

uint32_t hal_clock_ms(void)
{
    return bound->clock_ms;
}

static hal_status_t now(hal_status_t status)
{
    if (!bound->set.any)
        return HAL_ABSENT;
    return status == HAL_OK && !bound->fresh ? HAL_STALE : status;
}

hal_status_t hal_imu_read(hal_imu_t *out)
{
    const hal_status_t status = now(bound->set.imu_status);
    if (status == HAL_OK)
        *out = bound->set.imu;
    return status;
}

hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    const hal_status_t status = now(bound->set.rotation_status);
    if (status == HAL_OK)
        *out = bound->set.rotation;
    return status;
}

hal_status_t hal_reference_read(hal_reference_t *out)
{
    const hal_status_t status = now(bound->set.reference_status);
    if (status == HAL_OK)
        *out = bound->set.reference;
    return status;
}

hal_status_t hal_battery_read(uint16_t *out_mv)
{
    const hal_status_t status = now(bound->set.battery_status);
    if (status == HAL_OK)
        *out_mv = bound->set.battery_mv;
    return status;
}

void hal_motors_write(int16_t left_q15, int16_t right_q15)
{
    bound->left_q15 = left_q15;
    bound->right_q15 = right_q15;
    if (bound->set.any)
        send_motors(bound);
}

bool hal_link_write(const message_t *message)
{
    const bool room = bound->out_size < LINK_OUT;

    send(bound, message);
    if (!room)
        return false;
    if (message->id == WIRE_HEARTBEAT_FRAME_ID)
        send_faults(bound);
    return true;
}

bool hal_link_read(message_t *message)
{
    if (bound->in_size == 0)
        return false;
    *message = bound->in[bound->in_first];
    bound->in_first = (uint8_t)((bound->in_first + 1U) % LINK_IN);
    bound->in_size--;
    return true;
}
