#include "rcx/infrared.h"

#include <lnp.h>
#include <unistd.h>

#include "hal.h"
#include "wire/codecs_gen.h"

typedef uint8_t packet_t[INFRARED_PACKET]; /* sequence, id, data */

static packet_t received;
static volatile bool full; /* `received` holds a packet that the controller has not read */
static uint16_t newest;    /* 256 + sequence number of the newest packet received; 0 before the first one */

/* A ring buffer. Only the controller counts `put`, and only the task that sends counts `taken`. Both wrap at 256. */
static packet_t waiting[INFRARED_WAITING];
static volatile uint8_t put, taken;

enum { NONE, SENT, DUE };
static packet_t reply; /* reply to the newest request */
static volatile uint8_t reply_is;
static uint8_t sequence;
uint8_t infrared_faults[MESSAGE_DATA_MAX];

static void count(uint8_t fault)
{
    uint8_t *const at = &infrared_faults[fault];
    const uint16_t counted = message_get(at);

    if (counted < 65535U)
        message_put(at, counted + 1U);
}

static void copy(uint8_t *to, const uint8_t *from, uint8_t size)
{
    do
        *to++ = *from++;
    while (--size > 0);
}

/* Runs in the kernel's receiving interrupt. */
static void receive(const unsigned char *data, unsigned char size, unsigned char source)
{
    const uint16_t sequence_and_256 = data[0] | 256U;

    (void)source;
    if (size != INFRARED_PACKET) {
        count(WIRE_FAULTS_BAD_AT);
    } else if (sequence_and_256 == newest) {
        count(WIRE_FAULTS_STALE_AT);
        if (reply_is == SENT)
            reply_is = DUE;
    } else if (full) {
        count(WIRE_FAULTS_LOST_AT);
    } else {
        newest = sequence_and_256;
        reply_is = NONE;
        copy(received, data, INFRARED_PACKET);
        full = true;
    }
}

bool hal_link_read(message_t *message)
{
    const uint8_t *const packet = received;

    if (!full)
        return false;
    message->id = message_get(packet + 1);
    message->size = MESSAGE_DATA_MAX;
    copy(message->data, packet + INFRARED_HEAD, MESSAGE_DATA_MAX);
    full = false;
    return true;
}

static void pack(uint8_t *packet, uint16_t id, const uint8_t *data)
{
    *packet++ = sequence++;
    message_put(packet, id);
    copy(packet + 2, data, MESSAGE_DATA_MAX);
}

static uint8_t *slot(uint8_t number)
{
    return waiting[number % INFRARED_WAITING];
}

static bool put_message(uint16_t id, const uint8_t *data)
{
    if ((uint8_t)(put - taken) == INFRARED_WAITING) {
        count(WIRE_FAULTS_LOST_AT);
        return false;
    }
    pack(slot(put), id, data);
    put++;
    return true;
}

bool hal_link_write(const message_t *message)
{
    if (message->id < WIRE_HEARTBEAT_FRAME_ID) {
        pack(reply, message->id, message->data);
        reply_is = DUE;
        return true;
    }
    if (!put_message(message->id, message->data))
        return false;
    if (message->id == WIRE_HEARTBEAT_FRAME_ID)
        (void)put_message(WIRE_FAULTS_FRAME_ID, infrared_faults);
    return true;
}

/* Condition for wait_event(). Returns 0 if there is nothing to send. */
static wakeup_t something_to_send(wakeup_t unused)
{
    (void)unused;
    return (reply_is & DUE) | (put ^ taken);
}

bool infrared_idle(void)
{
    return something_to_send(0) == 0;
}

/* The task that sends. wait_event() returns 0 when the program has to end. If a new reply overwrites the reply while
 * the kernel copies it, the copy's CRC is wrong, and the reply is sent again. */
static int send(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    while ((uint16_t)wait_event(&something_to_send, 0) != 0) {
        const bool replies = reply_is == DUE;

        if (replies)
            reply_is = SENT;
        (void)lnp_addressing_write(replies ? reply : slot(taken), INFRARED_PACKET, INFRARED_HOST, INFRARED_PORT);
        if (!replies)
            taken++;
    }
    return 0;
}

bool infrared_start(void)
{
    if (execi(&send, 0, 0, PRIO_NORMAL, INFRARED_STACK) == -1)
        return false;
    lnp_addressing_set_handler(INFRARED_PORT, &receive);
    return true;
}

void infrared_stop(void)
{
    lnp_addressing_set_handler(INFRARED_PORT, LNP_DUMMY_ADDRESSING);
}
