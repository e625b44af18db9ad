/* link.h: the HAL over messages: sensors come from and motors go to whoever is at the other end of a link.
 *
 * Free of any transport: the owner turns bytes into messages (wire/frame.h, wire/slcan.h) and hands them in, and takes those
 * that are to be sent. It calls the control loop, in lockstep when link_take() says LINK_STEP, in real time by its own
 * clock, and link_stepped() after each step. The binding is per thread.
 */
#ifndef BRICKPILOT_HAL_LINK_H
#define BRICKPILOT_HAL_LINK_H

#include "link/set.h"

enum { LINK_IN = 16, LINK_OUT = 32 };

/* All zero to begin with. */
typedef struct {
    set_t set;
    bool fresh; /* the set has come since the last step */
    uint32_t
        clock_ms; /* what hal_clock_ms() gives: link_take() sets it to the set's time, the owner of a clock to its own */
    int16_t left_q15; /* what the controller wrote last */
    int16_t right_q15;
    message_t in[LINK_IN]; /* rings: for hal_link_read(), and to be sent */
    message_t out[LINK_OUT];
    uint8_t in_first, in_size, out_first, out_size;
    uint16_t lost; /* messages of its own that found no room; stays at 65535 */
} link_port_t;

/* The port that this thread's HAL calls use from now on. The caller keeps it alive; NULL unbinds. */
void link_bind(link_port_t *port);

typedef enum {
    LINK_NOTHING = 0,
    LINK_STEP = 1,   /* a new set is there: in lockstep, a step is due */
    LINK_MESSAGE = 2 /* there is something for hal_link_read() */
} link_event_t;

/* A message has come. A set sent again is answered at once with the motors' last command. An OPEN, which begins a session,
 * makes the port forget the sets and counts of the one before. */
link_event_t link_take(link_port_t *port, const message_t *message);

/* The transport has found something that is no message. */
void link_count_bad(link_port_t *port);

/* The step is over: readings not renewed until the next are HAL_STALE. */
void link_stepped(link_port_t *port);

/* The next message to be sent, oldest first; false: none. */
bool link_give(link_port_t *port, message_t *message);

#endif
