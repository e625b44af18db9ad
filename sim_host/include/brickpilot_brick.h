/* brickpilot_brick.h: a brick in this process: the firmware behind its link. Python (cffi) calls this.
 *
 * It speaks messages (hal/wire/brickpilot.dbc): the caller carries them, over a CAN bus for instance. One thread at a time.
 * This header is read by cffi as it stands: plain declarations only.
 */
#ifndef BRICKPILOT_BRICK_H
#define BRICKPILOT_BRICK_H

typedef struct bp_brick bp_brick;

bp_brick *bp_brick_new(void); /* NULL: out of memory */
void bp_brick_free(bp_brick *brick);

/* A message has come: id 0..0x7FF, size 0..8. In lockstep the step that it makes due is done before this returns. Returns -1
 * where id or size is none, else 0. */
int bp_brick_take(bp_brick *brick, unsigned int id, const unsigned char *data, int size);

/* The next message to be sent: its size, with `id` and `data` (8 bytes) filled; -1: none. */
int bp_brick_give(bp_brick *brick, unsigned int *id, unsigned char *data);

/* Tells the time, monotonic, us; returns in how many us it wants to be told again. Steps in real time, and notices silence. */
long long bp_brick_time(bp_brick *brick, long long now_us);

/* The carriers, for whoever wants to compare. Encoders return the size written, at most 22; decoders take a whole line or
 * frame and return the data's size, or -1 where it is no message. */
int bp_frame_encode(unsigned int id, const unsigned char *data, int size, unsigned char *bytes);
int bp_frame_decode(const unsigned char *bytes, int count, unsigned int *id, unsigned char *data);
int bp_slcan_encode(unsigned int id, const unsigned char *data, int size, unsigned char *bytes);
int bp_slcan_decode(const unsigned char *bytes, int count, unsigned int *id, unsigned char *data);

#endif
