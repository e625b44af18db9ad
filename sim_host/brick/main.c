/* main.c: the process `brick`: the firmware at one end of a serial line, a TCP connection or an slcan adapter's line.
 *
 *   brick --pty | --serial PATH | --listen HOST:PORT | --slcan-pty | --slcan PATH   [--until-eof]
 *
 * --listen on an address that other machines reach needs BRICKPILOT_TOKEN in the environment, at both ends:
 * brick/token.h. The first line on stdout is the value for `brickpilot hil --link`. With --until-eof the process ends
 * when its standard input ends. SIGUSR1 restarts the brick, and the process prints a line that says so.
 */
#define _XOPEN_SOURCE 600
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "brick/brick.h"
#include "brick/line.h"
#include "wire/frame.h"
#include "wire/slcan.h"

enum { BAD_USAGE = 2, READ_SIZE = 512 };

typedef struct {
    brick_t brick;
    line_t line;
    bool slcan;
    frame_decoder_t frames;
    slcan_decoder_t lines;
    bool until_eof;
} process_t;

static volatile sig_atomic_t to_restart;

static void ask_for_restart(int number)
{
    (void)number;
    to_restart = 1;
}

static int64_t now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static void take_byte(process_t *process, uint8_t byte)
{
    message_t message;

    if (!process->slcan) {
        const frame_status_t status = frame_take(&process->frames, byte, &message);
        if (status == FRAME_MESSAGE)
            brick_take(&process->brick, &message);
        else if (status == FRAME_BAD)
            link_count_bad(&process->brick.port);
        return;
    }
    const slcan_status_t status = slcan_take(&process->lines, byte, &message);
    if (status == SLCAN_MESSAGE)
        brick_take(&process->brick, &message);
    else if (status == SLCAN_REPLY)
        (void)line_write(&process->line, process->lines.reply, process->lines.reply_size);
}

static void send_all(process_t *process)
{
    uint8_t bytes[SLCAN_SIZE_MAX]; /* room for the larger of the two encodings */
    message_t message;

    while (brick_give(&process->brick, &message)) {
        if (process->slcan && !process->lines.open)
            continue;
        const uint8_t size = process->slcan ? slcan_encode(&message, bytes) : frame_encode(&message, bytes);
        if (!line_write(&process->line, bytes, size) && process->brick.port.lost < 65535)
            process->brick.port.lost++;
    }
    line_flush(&process->line);
}

/* Reads the bytes that have come. False: the line is closed for good. */
static bool read_line(process_t *process)
{
    uint8_t bytes[READ_SIZE];
    const int got = line_read(&process->line, bytes, sizeof bytes);

    for (int i = 0; i < got; i++)
        take_byte(process, bytes[i]);
    if (got >= 0)
        return true;
    process->frames = (frame_decoder_t){.size = 0};
    process->lines = (slcan_decoder_t){.size = 0};
    return process->line.listening >= 0;
}

static bool stdin_has_ended(void)
{
    char bytes[64];
    return read(STDIN_FILENO, bytes, sizeof bytes) <= 0;
}

static void restart(process_t *process)
{
    to_restart = 0;
    brick_start(&process->brick);
    printf("restarted\n");
    fflush(stdout);
}

/* Serves the line until it ends. SIGUSR1 is unblocked only while ppoll() waits, so that no signal is missed. */
static int run(process_t *process)
{
    sigset_t blocked, before;
    const struct sigaction action = {.sa_handler = ask_for_restart};

    sigemptyset(&blocked);
    sigaddset(&blocked, SIGUSR1);
    sigprocmask(SIG_BLOCK, &blocked, &before);
    sigaction(SIGUSR1, &action, NULL);
    for (;;) {
        if (to_restart)
            restart(process);
        line_t *line = &process->line;
        const int64_t wait_us = brick_time(&process->brick, now_us());
        const struct timespec wait = {.tv_sec = (time_t)(wait_us / 1000000),
                                      .tv_nsec = (long)(wait_us % 1000000) * 1000};
        struct pollfd watched[3] = {
            {.fd = line->fd, .events = (short)(POLLIN | (line->pending_size > 0 ? POLLOUT : 0))},
            {.fd = line->listening, .events = POLLIN},
            {.fd = process->until_eof ? STDIN_FILENO : -1, .events = POLLIN}};

        send_all(process);
        if (ppoll(watched, 3, &wait, &before) < 0) {
            if (errno != EINTR)
                return 1;
            continue;
        }
        process->brick.now_us = now_us();
        if (watched[0].revents != 0 && !read_line(process))
            return 0;
        if (watched[1].revents != 0)
            line_accept(line);
        if (watched[2].revents != 0 && stdin_has_ended())
            return 0;
        send_all(process);
    }
}

static int refuse(const char *what, const char *why)
{
    if (errno != 0)
        fprintf(stderr, "brick: %s: %s: %s\n", what, why, strerror(errno));
    else
        fprintf(stderr, "brick: %s: %s\n", what, why);
    return BAD_USAGE;
}

/* Opens the line that an option names. Returns NULL, or what is wrong with the option. */
static const char *open_line(process_t *process, const char *option, const char *value)
{
    process->slcan = strncmp(option, "--slcan", 7) == 0;
    if (strcmp(option, "--pty") == 0 || strcmp(option, "--slcan-pty") == 0)
        return line_open_pty(&process->line);
    if (value == NULL)
        return "needs a value";
    return strcmp(option, "--listen") == 0 ? line_listen(&process->line, value)
                                           : line_open_serial(&process->line, value);
}

static bool takes_value(const char *option)
{
    return strcmp(option, "--serial") == 0 || strcmp(option, "--slcan") == 0 || strcmp(option, "--listen") == 0;
}

static bool opens_line(const char *option)
{
    return takes_value(option) || strcmp(option, "--pty") == 0 || strcmp(option, "--slcan-pty") == 0;
}

int main(int count, char **arguments)
{
    static process_t process;
    const char *option = NULL, *value = NULL;

    signal(SIGPIPE, SIG_IGN);
    for (int i = 1; i < count; i++) {
        errno = 0;
        if (strcmp(arguments[i], "--until-eof") == 0) {
            process.until_eof = true;
        } else if (opens_line(arguments[i]) && option == NULL) {
            option = arguments[i];
            value = takes_value(option) && i + 1 < count ? arguments[++i] : NULL;
        } else {
            return refuse(arguments[i], "is not expected here");
        }
    }
    errno = 0;
    if (option == NULL)
        return refuse("--pty, --serial PATH, --listen HOST:PORT, --slcan-pty or --slcan PATH", "is needed");
    const char *trouble = open_line(&process, option, value);
    if (trouble != NULL)
        return refuse(value != NULL ? value : option, trouble);
    brick_start(&process.brick);
    printf("%s:%s\n",
           process.slcan                 ? "can:slcan"
           : process.line.listening >= 0 ? "tcp"
                                         : "serial",
           process.line.address);
    fflush(stdout);
    return run(&process);
}
