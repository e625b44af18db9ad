/* line.h: what the brick's process talks over: a pseudo-terminal of its own, a serial port, or a TCP connection. POSIX. */
#ifndef BRICKPILOT_BRICK_LINE_H
#define BRICKPILOT_BRICK_LINE_H

#include <stdbool.h>
#include <stddef.h>

enum { LINE_ADDRESS_MAX = 128, LINE_PENDING = 4096 };

typedef struct {
    int fd;        /* -1: nobody is connected */
    int listening; /* -1, or the socket that takes connections */
    int slave;     /* -1, or our own pseudo-terminal's far end, kept open so that it outlives its users */
    char address[LINE_ADDRESS_MAX]; /* what to connect to: a path, or HOST:PORT */
    unsigned char pending[LINE_PENDING];
    size_t pending_size; /* bytes that the other end has not taken yet */
} line_t;

/* Each gives NULL, or what failed, with errno set where errno says why. */
const char *line_open_pty(line_t *line);
const char *line_open_serial(line_t *line, const char *path);
const char *line_listen(line_t *line, const char *host_and_port); /* port 0: any free one */

/* Takes the connection that waits on `listening`, instead of the one there was. */
void line_accept(line_t *line);

/* Bytes read, 0: none now; -1: the other end has gone, and a listening line waits for the next. */
int line_read(line_t *line, unsigned char *bytes, size_t room);

/* All of it is sent or kept for later; false: no room, nothing is kept. */
bool line_write(line_t *line, const unsigned char *bytes, size_t size);

/* Sends what was kept, as far as the other end takes it. */
void line_flush(line_t *line);

#endif
