#include "rcx/infrared.h"

#include <lnp.h>
#include <unistd.h>

#include "hal.h"
#include "wire/codecs_gen.h"

typedef struct {
    uint8_t size;
    uint8_t bytes[INFRARED_HEAD + MESSAGE_DATA_MAX];
} packet_t;

/* Rings: one side alone counts `put`, the other alone `taken`, and both wrap at 256. */
typedef struct {
    packet_t packets[INFRARED_WAITING];
    volatile uint8_t put, taken;
} ring_t;

static ring_t in, out;
static packet_t answer; /* to the newest request; size 0: not there yet */
static volatile bool answer_due;
static uint8_t sequence_in, sequence_out;
static bool heard;
static infrared_counts_t counts;

static void count(uint16_t *what)
{
    if (*what < 65535U)
        (*what)++;
}

static packet_t *room(ring_t *ring)
{
    if ((uint8_t)(ring->put - ring->taken) == INFRARED_WAITING) {
        count(&counts.lost);
        return 0;
    }
    return &ring->packets[ring->put % INFRARED_WAITING];
}

/* In the kernel's receiving interrupt. */
static void receive(const unsigned char *data, unsigned char size, unsigned char source)
{
    packet_t *packet;

    (void)source;
    if (size < INFRARED_HEAD || size > sizeof packet->bytes) {
        count(&counts.bad);
        return;
    }
    packet = room(&in);
    if (packet == 0)
        return;
    packet->size = size;
    for (uint8_t i = 0; i < size; i++)
        packet->bytes[i] = data[i];
    in.put++;
}

bool hal_link_read(message_t *message)
{
    while (in.taken != in.put) {
        const packet_t *const packet = &in.packets[in.taken % INFRARED_WAITING];
        const bool repeated = heard && packet->bytes[0] == sequence_in;

        if (repeated) {
            count(&counts.repeated);
            answer_due = answer.size > 0;
        } else {
            heard = true;
            sequence_in = packet->bytes[0];
            answer.size = 0;
            message->id = (uint16_t)(packet->bytes[1] | packet->bytes[2] << 8);
            message->size = (uint8_t)(packet->size - INFRARED_HEAD);
            for (uint8_t i = 0; i < message->size; i++)
                message->data[i] = packet->bytes[INFRARED_HEAD + i];
        }
        in.taken++;
        if (!repeated)
            return true;
    }
    return false;
}

static void pack(packet_t *packet, const message_t *message)
{
    packet->bytes[0] = sequence_out++;
    packet->bytes[1] = (uint8_t)message->id;
    packet->bytes[2] = (uint8_t)(message->id >> 8);
    for (uint8_t i = 0; i < message->size; i++)
        packet->bytes[INFRARED_HEAD + i] = message->data[i];
    packet->size = (uint8_t)(INFRARED_HEAD + message->size);
}

static bool put(const message_t *message)
{
    packet_t *const packet = room(&out);

    if (packet == 0)
        return false;
    pack(packet, message);
    out.put++;
    return true;
}

static void put_faults(void)
{
    struct wire_faults_t faults;
    message_t message;

    faults.bad = counts.bad;
    faults.incomplete = 0;
    faults.stale = counts.repeated;
    faults.lost = counts.lost;
    message.id = WIRE_FAULTS_FRAME_ID;
    message.size = WIRE_FAULTS_LENGTH;
    (void)wire_faults_pack(message.data, &faults, MESSAGE_DATA_MAX);
    (void)put(&message);
}

bool hal_link_write(const message_t *message)
{
    if (message->id < WIRE_HEARTBEAT_FRAME_ID) {
        pack(&answer, message);
        answer_due = true;
        return true;
    }
    if (!put(message))
        return false;
    if (message->id == WIRE_HEARTBEAT_FRAME_ID)
        put_faults();
    return true;
}

bool infrared_idle(void)
{
    return !answer_due && out.put == out.taken;
}

infrared_counts_t infrared_counts(void)
{
    return counts;
}

static wakeup_t something_to_send(wakeup_t unused)
{
    (void)unused;
    return !infrared_idle();
}

/* A task. wait_event() gives 0 when the program is to end. An answer that is replaced while it is copied here has a check that fails,
 * and is sent once more. */
static int send(int argc, char **argv)
{
    packet_t packet;

    (void)argc;
    (void)argv;
    while (wait_event(&something_to_send, 0) != 0) {
        if (answer_due) {
            answer_due = false;
            packet = answer;
        } else {
            packet = out.packets[out.taken % INFRARED_WAITING];
            out.taken++;
        }
        (void)lnp_addressing_write(packet.bytes, packet.size, INFRARED_HOST, INFRARED_PORT);
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
