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
    int slave;     /* -1, or the far end of our pseudo-terminal: kept open, or it would close when its user leaves */
    char address[LINE_ADDRESS_MAX]; /* address for the other end: a path, or HOST:PORT */
    unsigned char pending[LINE_PENDING];
    size_t pending_size; /* bytes that the other end has not taken yet */

    const char *token; /* the token that a client of a listening line has to know; NULL: none */
    bool proved;       /* the client knows the token, or needs none */
    time_t asked_s;
    char challenge[TOKEN_DIGITS + 1];
    char proof[TOKEN_DIGITS + TOKEN_PROOF]; /* the part of the client's digits and proof that has come */
    size_t proof_size;
} line_t;

/* These functions open a line. They return NULL, or a text that says what failed; errno may say why. */
const char *line_open_pty(line_t *line);
const char *line_open_serial(line_t *line, const char *path);
const char *line_listen(line_t *line, const char *host_and_port); /* port 0: any free one */

/* The environment variable with the token of a listening line, of TOKEN_LEAST to TOKEN_MOST bytes. Without a token, a
 * brick does not listen on an address that other machines reach. */
#define LINE_TOKEN "BRICKPILOT_TOKEN"

/* Sent to a client that comes while another client has the line, with a 0 byte before and after the text. */
#define LINE_BUSY "another host has this link"

/* Sent to a client before the challenge, and to a client whose proof is wrong; with a 0 byte before and after the
 * text. */
#define LINE_ASKS "token "
#define LINE_WRONG "the token is wrong"

/* Time in s after which the next client replaces a client that has not proved the token. */
enum { LINE_PROOF_S = 2 };

/* Accepts the connection that waits on `listening`. The first client keeps the line until it leaves. Another client is
 * sent away with LINE_BUSY, or waits for the next call if bytes or the end of the first client are unread. If the line
 * has a token, a client has to prove it first; a client without proof may be replaced after LINE_PROOF_S. */
void line_accept(line_t *line);

/* Returns the number of bytes read. 0: none at present. -1: the other end has gone; a listening line waits for a new
 * client. */
int line_read(line_t *line, unsigned char *bytes, size_t room);

/* Sends all bytes or keeps them for later. False: there is no room, and no byte is kept. */
bool line_write(line_t *line, const unsigned char *bytes, size_t size);

/* Sends kept bytes, as far as the other end takes them. */
void line_flush(line_t *line);

#endif
