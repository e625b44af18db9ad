/* infrared.h: messages over the infrared link, one in an addressed packet of LNP:
 *
 *   F1 | size + 2 | to | from | sequence | id low | id high | 0..8 data | sum
 *
 * At 2400 baud a message of 8 bytes takes 73 ms. Sending waits for that, so a task of its own does it. The kernel's receiving
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
    INFRARED_WAITING = 8, /* messages that wait for the controller, and to be sent */
    INFRARED_STACK = 224
};

/* Since the start; each stays at 65535. FAULTS tells them, behind every HEARTBEAT. */
typedef struct {
    uint16_t bad;      /* too short or too long for a message */
    uint16_t repeated; /* FAULTS.stale */
    uint16_t lost;     /* without room at either side */
} infrared_counts_t;

/* Listens, and starts the task that sends. False: no memory for that. */
bool infrared_start(void);
void infrared_stop(void);

/* Everything written has been handed to the kernel. */
bool infrared_idle(void);

infrared_counts_t infrared_counts(void);

#endif
