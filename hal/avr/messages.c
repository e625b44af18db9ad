/* messages.c: the link of hal.h, in frames (wire/frame.h) on the serial line. */
#include "avr/analogue.h"
#include "avr/digital.h"
#include "avr/guard.h"
#include "avr/rotation.h"
#include "avr/serial.h"
#include "hal.h"
#include "wire/codecs_gen.h"
#include "wire/crc.h"
#include "wire/frame.h"

static frame_decoder_t decoder;
static uint16_t bad, without_room, overruns_before;

static void count(uint16_t *counter)
{
    if (*counter < 65535U)
        ++*counter;
}

/* The message FAULTS counts from OPEN on. */
static void begin_session(void)
{
    bad = without_room = 0;
    overruns_before = serial_overruns();
}

bool hal_link_read(message_t *message)
{
    uint8_t byte;

    while (serial_read(&byte)) {
        switch (frame_take(&decoder, byte, message)) {
        case FRAME_MESSAGE:
            if (message->id == WIRE_OPEN_FRAME_ID && crc_holds(message))
                begin_session();
            return true;
        case FRAME_BAD:
            count(&bad);
            return false; /* the other bytes wait: a call takes at most the time of one frame */
        case FRAME_MORE:
            break;
        }
    }
    return false;
}

static bool send(const message_t *message)
{
    uint8_t bytes[FRAME_SIZE_MAX];

    if (!serial_has_room(FRAME_SIZE_MAX)) { /* checked first, since encoding a frame takes time */
        count(&without_room);
        return false;
    }
    serial_write(bytes, frame_encode(message, bytes));
    return true;
}

static void send_faults(void)
{
    const uint16_t overruns = serial_overruns() - overruns_before, lost = without_room + overruns;
    message_t message = {.id = WIRE_FAULTS_FRAME_ID, .size = WIRE_FAULTS_LENGTH};

    message_put(&message.data[WIRE_FAULTS_BAD_AT], bad);
    message_put(&message.data[WIRE_FAULTS_LOST_AT], lost < overruns ? 65535U : lost);
    (void)send(&message);
}

static void send_board(void)
{
    const uint16_t digital = digital_faults(), missed = analogue_faults() + digital;
    message_t message = {.id = WIRE_BOARD_FRAME_ID, .size = WIRE_BOARD_LENGTH};

    message.data[WIRE_BOARD_STARTED_BY_AT] = guard_cause();
    message_put(&message.data[WIRE_BOARD_CONVERTER_AT], missed < digital ? 65535U : missed);
    message_put(&message.data[WIRE_BOARD_EDGES_AT], rotation_errors());
    message_put(&message.data[WIRE_BOARD_OVERRUNS_AT], serial_overruns());
    (void)send(&message);
}

bool hal_link_write(const message_t *message)
{
    if (!send(message))
        return false;
    if (message->id == WIRE_HEARTBEAT_FRAME_ID) {
        send_faults();
        send_board();
    }
    return true;
}
