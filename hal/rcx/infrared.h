/* infrared.h: messages over the infrared link, one in an addressed packet of LNP:
 *
 *   F1 | 13 | to | from | sequence | id low | id high | 8 data | sum
 *
 * At 2400 baud one takes 73 ms. Sending waits for that, so a task of its own does it. The kernel's receiving
 * interrupt only copies. A packet with the sequence number of the one before it is a repetition, whose answer was lost: it is not
 * given to the controller again, its answer is sent again. Answers go before telemetry; each takes the place of the one before.
 */
#ifndef BRICKPILOT_RCX_INFRARED_H
#define BRICKPILOT_RCX_INFRARED_H

#include <stdbool.h>
#include <stdint.h>

enum {
    INFRARED_PORT = 7,    /* of the brick; 0 is the kernel's, for programs */
    INFRARED_HOST = 0x87, /* address and port that is sent to */
    INFRARED_HEAD = 3,    /* sequence and id */
    INFRARED_PACKET = 11, /* with 8 data, which all messages have */
    INFRARED_WAITING =
        8, /* to be sent; one alone waits for the controller, which is ready for the next before that is here */
    INFRARED_STACK = 224
};

/* The data of FAULTS, which goes behind every HEARTBEAT: since the start, what was no message (bad), repeated (stale), or without room
 * at either side (lost). Each stays at 65535. */
extern uint8_t infrared_faults[8];

/* Listens, and starts the task that sends. False: no memory for that. */
bool infrared_start(void);
void infrared_stop(void);

/* Everything written has been sent. */
bool infrared_idle(void);

#endif
