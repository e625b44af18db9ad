/* line.h: the transports of the brick's process on POSIX: a pseudo-terminal of its own, a serial port, or TCP. */
#ifndef BRICKPILOT_BRICK_LINE_H
#define BRICKPILOT_BRICK_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <time.h>

#include "brick/token.h"

enum { LINE_ADDRESS_MAX = 128, LINE_PENDING = 4096 };

typedef struct {
    int fd;        /* -1: nobody is connected */
    int listening; /* -1, or the socket that accepts connections */
    int slave;     /* -1, or the far end of our pseudo-terminal, kept open so that it stays when its user leaves */
    char address[LINE_ADDRESS_MAX]; /* what to connect to: a path, or HOST:PORT */
    unsigned char pending[LINE_PENDING];
    size_t pending_size; /* bytes that the other end has not taken yet */

    const char *token; /* NULL, or what a client of a listening line has to know */
    bool proved;       /* the client knows the token, or needs none */
    time_t asked_s;
    char challenge[TOKEN_DIGITS + 1];
    char proof[TOKEN_DIGITS + TOKEN_PROOF]; /* the client's digits and proof, as far as they have come */
    size_t proof_size;
} line_t;

/* Each opens a line. Returns NULL, or what failed, with errno set where errno says why. */
const char *line_open_pty(line_t *line);
const char *line_open_serial(line_t *line, const char *path);
const char *line_listen(line_t *line, const char *host_and_port); /* port 0: any free one */

/* The environment variable with the token of a listening line, of TOKEN_LEAST to TOKEN_MOST bytes. Without a token, a
 * brick does not listen on an address that other machines reach. */
#define LINE_TOKEN "BRICKPILOT_TOKEN"

/* Sent to a client that comes while another client has the line; a 0 stands before and behind it. */
#define LINE_BUSY "another host has this link"

/* Sent to a client before the challenge; sent to a client whose proof is wrong. A 0 stands before and behind both. */
#define LINE_ASKS "token "
#define LINE_WRONG "the token is wrong"

/* Seconds after which a client that has not proved the token makes way for the next one. */
enum { LINE_PROOF_S = 2 };

/* Accepts the connection that waits on `listening`. The first client keeps the line until it leaves; another client is
 * sent away with LINE_BUSY, but waits for the next call while bytes of the first, or its end, are unread. If the line
 * has a token, the client has to prove it first; a client that has not is replaced after LINE_PROOF_S. */
void line_accept(line_t *line);

/* Returns the number of bytes read. 0: none at present. -1: the other end has gone; a listening line waits for the
 * next.
 */
int line_read(line_t *line, unsigned char *bytes, size_t room);

/* Sends all bytes or keeps them for later. False: there is no room, and none is kept. */
bool line_write(line_t *line, const unsigned char *bytes, size_t size);

/* Sends kept bytes, as far as the other end takes them. */
void line_flush(line_t *line);

#endif
