/* brickpilot_brick.h: a brick in this process: the firmware behind its link. Python calls this through cffi.
 *
 * The caller carries the messages of hal/wire/brickpilot.dbc, for example over a CAN bus. Use a brick on one thread at
 * a time. cffi reads this header unchanged, so it holds plain declarations only.
 */
#ifndef BRICKPILOT_BRICK_H
#define BRICKPILOT_BRICK_H

typedef struct bp_brick bp_brick;

bp_brick *bp_brick_new(void); /* NULL: out of memory */
void bp_brick_free(bp_brick *brick);

/* Takes a message that has come: id 0..0x7FF, size 0..8. In lockstep, if a step is now due, this also does
 * the step. Returns 0, or -1 if id or size is out of range. */
int bp_brick_take(bp_brick *brick, unsigned int id, const unsigned char *data, int size);

/* Hands over the next message to be sent: returns its size, and fills `id` and `data` (8 bytes). -1: there is none. */
int bp_brick_give(bp_brick *brick, unsigned int *id, unsigned char *data);

/* Tells the brick the time in us, which never goes back. Returns the time in us after which the caller has to call
 * again. This call does the steps in real time, and detects silence. */
long long bp_brick_time(bp_brick *brick, long long now_us);

/* The codecs of the transports, for tests and benchmarks. An encoder returns the number of bytes written, at most 22. A
 * decoder takes one whole line or frame and returns the size of the data, or -1 if there is no message. */
int bp_frame_encode(unsigned int id, const unsigned char *data, int size, unsigned char *bytes);
int bp_frame_decode(const unsigned char *bytes, int count, unsigned int *id, unsigned char *data);
int bp_slcan_encode(unsigned int id, const unsigned char *data, int size, unsigned char *bytes);
int bp_slcan_decode(const unsigned char *bytes, int count, unsigned int *id, unsigned char *data);

#endif
