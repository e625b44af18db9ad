/* infrared.h: messages over the infrared link, each in one addressed packet of LNP:
 *
 *   F1 | 13 | to | from | sequence | id low | id high | 8 data | sum
 *
 * A packet takes 73 ms at 2400 baud. Sending blocks for this time, so a separate task sends. The kernel's receiving
 * interrupt only copies. A packet with the same sequence number as the previous packet is a repetition: the reply was
 * lost. The port does not give a repetition to the controller; it sends the reply again. Replies are sent before
 * telemetry, and a new reply replaces the old one.
 */
#ifndef BRICKPILOT_RCX_INFRARED_H
#define BRICKPILOT_RCX_INFRARED_H

#include <stdbool.h>
#include <stdint.h>

enum {
    INFRARED_PORT = 7,    /* port of the brick; port 0 belongs to the kernel, which loads programs there */
    INFRARED_HOST = 0x87, /* address and port of the host */
    INFRARED_HEAD = 3,    /* bytes of sequence and id */
    INFRARED_PACKET = 11, /* bytes of a packet: sequence, id and the 8 data bytes that every message has */
    INFRARED_WAITING =
        8, /* packets to be sent. Only one received packet waits: the controller reads it before the next one is here */
    INFRARED_STACK = 224
};

/* The data of the message FAULTS, which follows every HEARTBEAT. It counts, since the start: packets that were no message (bad),
 * repetitions (stale), and messages that found no room in either direction (lost). Each count saturates at 65535. */
extern uint8_t infrared_faults[8];

/* Starts to receive, and starts the task that sends. False if there is no memory for the task. */
bool infrared_start(void);
void infrared_stop(void);

/* True if no message waits to be sent. */
bool infrared_idle(void);

#endif
