/* link.h: the HAL port over messages. Sensor readings come from the other end of a link, and motor commands go there.
 *
 * The port knows no transport: its owner converts bytes into messages (wire/frame.h, wire/slcan.h), passes them to
 * link_take(), and sends the messages that link_give() returns. The owner also calls the control loop: in lockstep
 * when link_take() returns LINK_STEP, in real time by its own clock. After each step it calls link_stepped(). The
 * binding is per thread.
 */
#ifndef BRICKPILOT_HAL_LINK_H
#define BRICKPILOT_HAL_LINK_H

#include "link/set.h"

enum { LINK_IN = 16, LINK_OUT = 32 };

/* All fields are 0 at the start. */
typedef struct {
    set_t set;
    bool fresh; /* the newest set came after the last step */
    uint32_t
        clock_ms; /* what hal_clock_ms() returns: link_take() writes the set's time; an owner with a clock writes its own */
    int16_t left_q15; /* the last duties that the controller wrote */
    int16_t right_q15;
    message_t in[LINK_IN]; /* ring buffers: messages for hal_link_read(), and messages to be sent */
    message_t out[LINK_OUT];
    uint8_t in_first, in_size, out_first, out_size;
    uint16_t lost; /* messages that the port could not send for lack of room; saturates at 65535 */
} link_port_t;

/* From now on this thread's calls of the HAL use `port`, which must outlive its use. NULL: no port. */
void link_bind(link_port_t *port);

typedef enum {
    LINK_NOTHING = 0,
    LINK_STEP = 1,   /* a new set has come: in lockstep, a step is due */
    LINK_MESSAGE = 2 /* hal_link_read() has a message */
} link_event_t;

/* Takes a message that has come. If a set is sent again, the port replies at once with the last motor command. An OPEN begins
 * a session: the port then forgets the sets and counts of the previous session. */
link_event_t link_take(link_port_t *port, const message_t *message);

/* Counts bytes that the transport found to be no message. */
void link_count_bad(link_port_t *port);

/* Call this after each step. Readings that do not come again before the next step are HAL_STALE. */
void link_stepped(link_port_t *port);

/* Gives the oldest message that waits to be sent. False if there is none. */
bool link_give(link_port_t *port, message_t *message);

#endif
