#define _XOPEN_SOURCE 600
#define _DEFAULT_SOURCE
#include "brick/line.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static void clear(line_t *line)
{
    line->fd = line->listening = line->slave = -1;
    line->pending_size = 0;
    line->address[0] = 0;
    line->token = NULL;
    line->proved = true;
}

static int set_raw(int fd)
{
    struct termios settings;
    if (tcgetattr(fd, &settings) != 0)
        return -1;
    cfmakeraw(&settings);
    cfsetspeed(&settings, B115200);
    return tcsetattr(fd, TCSANOW, &settings);
}

static int set_nonblocking(int fd)
{
    return fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
}

const char *line_open_pty(line_t *line)
{
    clear(line);
    line->fd = posix_openpt(O_RDWR | O_NOCTTY);
    if (line->fd < 0 || grantpt(line->fd) != 0 || unlockpt(line->fd) != 0)
        return "no pseudo-terminal is to be had";
    snprintf(line->address, sizeof line->address, "%s", ptsname(line->fd));
    line->slave = open(line->address, O_RDWR | O_NOCTTY);
    if (line->slave < 0 || set_raw(line->slave) != 0 || set_nonblocking(line->fd) != 0)
        return "the pseudo-terminal does not open";
    return NULL;
}

const char *line_open_serial(line_t *line, const char *path)
{
    clear(line);
    if (strlen(path) >= sizeof line->address)
        return "the path is too long";
    snprintf(line->address, sizeof line->address, "%s", path);
    line->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (line->fd < 0)
        return "it does not open";
    if (set_raw(line->fd) != 0)
        return "it is no serial port";
    return NULL;
}

static const char *split(const char *host_and_port, char *host, size_t room, const char **port)
{
    const char *colon = strrchr(host_and_port, ':');
    errno = 0;
    if (colon == NULL || colon[1] == 0 || (size_t)(colon - host_and_port) >= room)
        return "HOST:PORT is wanted";
    memcpy(host, host_and_port, (size_t)(colon - host_and_port));
    host[colon - host_and_port] = 0;
    *port = colon + 1;
    return NULL;
}

/* Takes the token from the environment. Returns NULL, or why the brick may not listen on this address without a token:
 * anyone who reaches the line can command the robot. */
static const char *take_token(line_t *line, const struct sockaddr_in *address)
{
    const char *token = getenv(LINE_TOKEN);
    const size_t size = token == NULL ? 0 : strlen(token);

    if (size == 0)
        return ntohl(address->sin_addr.s_addr) >> 24 == 127 ? NULL : "other machines reach it: set " LINE_TOKEN;
    if (size < TOKEN_LEAST || size > TOKEN_MOST)
        return LINE_TOKEN " needs 16 to 64 bytes";
    line->token = token;
    return NULL;
}

const char *line_listen(line_t *line, const char *host_and_port)
{
    const struct addrinfo wanted = {.ai_family = AF_INET, .ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE};
    struct sockaddr_in bound;
    socklen_t size = sizeof bound;
    struct addrinfo *found;
    char host[LINE_ADDRESS_MAX / 2];
    const char *port;
    const int yes = 1;
    const char *trouble = split(host_and_port, host, sizeof host, &port);

    clear(line);
    if (trouble != NULL)
        return trouble;
    if (getaddrinfo(host, port, &wanted, &found) != 0)
        return "no such host or port";
    trouble = take_token(line, (const struct sockaddr_in *)(const void *)found->ai_addr);
    if (trouble != NULL) {
        freeaddrinfo(found);
        errno = 0;
        return trouble;
    }
    line->listening = socket(found->ai_family, found->ai_socktype, found->ai_protocol);
    if (line->listening >= 0)
        setsockopt(line->listening, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (line->listening < 0 || bind(line->listening, found->ai_addr, found->ai_addrlen) != 0 ||
        listen(line->listening, 1) != 0 || set_nonblocking(line->listening) != 0 ||
        getsockname(line->listening, (struct sockaddr *)&bound, &size) != 0)
        trouble = "it cannot be listened on";
    freeaddrinfo(found);
    if (trouble == NULL)
        snprintf(line->address, sizeof line->address, "%s:%u", host, (unsigned)ntohs(bound.sin_port));
    return trouble;
}

/* True if the present client is still connected and all its bytes have been read. */
static bool is_quiet(int fd)
{
    char byte;

    return recv(fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
}

/* Sends words between two 0 bytes, so that they are not part of a frame. */
static void tell(int fd, const char *words)
{
    char bytes[2 + TOKEN_TEXT_MOST] = {0};
    const int size = snprintf(bytes + 1, sizeof bytes - 1, "%s", words);

    (void)send(fd, bytes, (size_t)size + 2, MSG_NOSIGNAL | MSG_DONTWAIT);
}

/* Reads what the client has sent before the socket closes: unread bytes would make the close discard the words. */
static void send_away(int fd)
{
    char bytes[64];

    tell(fd, LINE_BUSY);
    shutdown(fd, SHUT_WR);
    while (recv(fd, bytes, sizeof bytes, MSG_DONTWAIT) > 0) {
    }
    close(fd);
}

static time_t now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec;
}

/* Ends the connection. Always returns -1. */
static int drop(line_t *line)
{
    close(line->fd);
    line->fd = -1;
    line->pending_size = 0;
    return -1;
}

static void ask_for_proof(line_t *line)
{
    uint8_t random[TOKEN_DIGITS / 2];
    char words[sizeof LINE_ASKS + TOKEN_DIGITS];

    if (getentropy(random, sizeof random) != 0) {
        (void)drop(line);
        return;
    }
    token_digits(random, sizeof random, line->challenge);
    line->proof_size = 0;
    line->asked_s = now_s();
    snprintf(words, sizeof words, LINE_ASKS "%s", line->challenge);
    tell(line->fd, words);
}

/* Takes bytes of the client's proof. Returns 0, or -1 if the proof is wrong, which ends the connection. */
static int take_proof(line_t *line, const unsigned char *bytes, size_t size)
{
    char wanted[TOKEN_PROOF + 1];

    if (size <= sizeof line->proof - line->proof_size) {
        memcpy(line->proof + line->proof_size, bytes, size);
        line->proof_size += size;
        if (line->proof_size < sizeof line->proof)
            return 0;
        token_proof(line->token, "host", line->challenge, line->proof, wanted);
        if (token_equal(wanted, line->proof + TOKEN_DIGITS)) {
            token_proof(line->token, "brick", line->challenge, line->proof, wanted);
            tell(line->fd, wanted);
            line->proved = true;
            return 0;
        }
    }
    tell(line->fd, LINE_WRONG);
    return drop(line);
}

void line_accept(line_t *line)
{
    const int yes = 1;
    int fd;

    if (line->fd >= 0 && !is_quiet(line->fd))
        return;
    if (line->fd >= 0 && !line->proved && now_s() - line->asked_s > LINE_PROOF_S)
        (void)drop(line);
    fd = accept(line->listening, NULL, NULL);
    if (fd < 0)
        return;
    if (line->fd >= 0) {
        send_away(fd);
        return;
    }
    line->fd = fd;
    line->pending_size = 0;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    set_nonblocking(fd);
    line->proved = line->token == NULL;
    if (!line->proved)
        ask_for_proof(line);
}

int line_read(line_t *line, unsigned char *bytes, size_t room)
{
    const ssize_t got = read(line->fd, bytes, room);

    if (got > 0 && !line->proved)
        return take_proof(line, bytes, (size_t)got);
    if (got > 0)
        return (int)got;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR))
        return 0;
    return line->listening >= 0 ? drop(line) : -1;
}

bool line_write(line_t *line, const unsigned char *bytes, size_t size)
{
    if (line->fd < 0 || !line->proved || size > LINE_PENDING - line->pending_size)
        return false;
    memcpy(line->pending + line->pending_size, bytes, size);
    line->pending_size += size;
    return true;
}

void line_flush(line_t *line)
{
    ssize_t sent;

    if (line->fd < 0 || line->pending_size == 0)
        return;
    sent = write(line->fd, line->pending, line->pending_size);
    if (sent <= 0)
        return;
    line->pending_size -= (size_t)sent;
    memmove(line->pending, line->pending + sent, line->pending_size);
}
