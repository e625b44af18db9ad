/* brick.h: the firmware on the link port, without a transport and without a clock: its caller carries the messages and
 * tells the time.
 *
 * In lockstep the brick does a step as soon as a set of readings is complete. In real time it does a step every
 * STEP_MS. In lockstep the plant's clock stands still while no message comes. So after BRICK_SILENT_US without a valid
 * message the brick adds this time to its clock, which ends a run. In real time the firmware's own silent_ms ends a
 * run.
 */
#ifndef BRICKPILOT_BRICK_BRICK_H
#define BRICKPILOT_BRICK_BRICK_H

#include "app/serve.h"
#include "link/link.h"

#define BRICK_STEP_US (STEP_MS * 1000)
#define BRICK_SILENT_US 1000000

typedef struct {
    link_port_t port;
    commands_t commands;
    loop_state_t loop;
    int64_t now_us;   /* the newest time from the caller */
    int64_t heard_us; /* when the last valid message came */
    int64_t next_us;  /* when the next step in real time is due */
} brick_t;

void brick_start(brick_t *brick);

/* Takes a message that has come. */
void brick_take(brick_t *brick, const message_t *message);

/* Hands over the next message to be sent; false: there is none. */
bool brick_give(brick_t *brick, message_t *message);

/* Tells the brick the time `now_us`, which never goes back. Returns the time in us, 0 or more, after which the caller
 * has to call again. */
int64_t brick_time(brick_t *brick, int64_t now_us);

#endif
