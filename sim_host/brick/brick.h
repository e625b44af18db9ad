/* brick.h: the firmware on the link port, free of any carrier and of any clock but the one it is told.
 *
 * In lockstep a step is done as soon as a set of readings is whole. In real time steps follow the clock, every 3 ms. When
 * nothing valid has been heard for BRICK_SILENT_US in lockstep, where the plant's clock stands still, the brick takes that
 * time for passed and cuts the run; in real time the firmware's own silent_ms does it.
 */
#ifndef BRICKPILOT_BRICK_BRICK_H
#define BRICKPILOT_BRICK_BRICK_H

#include "app/serve.h"
#include "link/link.h"

#define BRICK_STEP_US 3000
#define BRICK_SILENT_US 1000000

typedef struct {
    link_port_t port;
    commands_t commands;
    loop_state_t loop;
    int64_t now_us;   /* as told last */
    int64_t heard_us; /* when something valid came last */
    int64_t next_us;  /* when the next step in real time is due */
} brick_t;

void brick_start(brick_t *brick);

/* A message has come. */
void brick_take(brick_t *brick, const message_t *message);

/* The next message to be sent; false: none. */
bool brick_give(brick_t *brick, message_t *message);

/* The time is `now_us`, monotonic. Returns after how many us to tell it again, 0 or more. */
int64_t brick_time(brick_t *brick, int64_t now_us);

#endif
