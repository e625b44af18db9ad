/* console.h: the surroundings of a simulated RCX, controlled by commands on the simulator's standard input. Numbers
 * are big-endian; the number in brackets is the size in bytes:
 *
 *   r ms(2)                time passes
 *   l byte(1) wrong(1)     the brick receives a byte, which takes the time of a byte; wrong not 0: with a wrong parity
 *   k keys(1)              these buttons are held: 1 On-Off, 2 Run, 4 View, 8 Prgm
 *   a input(1) raw(2)      sets what the converter measures at input 1, 2 or 3, or at the battery (input 0): 0..1023
 *   m address(2) size(2)   the reply is the content of the memory from this address on
 *   b address(2)           from now on records the time whenever the instruction at this address begins
 *   e                      the reply is the number of recorded times (2) and these times, in states since the start
 *                          (8 each). The recorded times are then cleared
 *   t                      the reply is the time since the start (8), and for each kind of chip.h how often it came (4) and how
 *                          long it took (8), both since the start
 *   f size(1) path         starts a copy of this brick as a new process, which takes commands from the socket `path`
 *
 * The reply to r and l is: how long motors A and C were driven in that time, forward minus backward (us, 4 bytes each,
 * signed), the number of bytes that the brick has sent (2), and those bytes. The program ends when its input ends.
 */
#ifndef BRICKPILOT_H8SIM_CONSOLE_H
#define BRICKPILOT_H8SIM_CONSOLE_H

#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "chip.h"

enum { MOTORS = 0xFF80, STATES_A_MS = 16000, STATES_A_US = 16, LINE_BYTE = 73333 }; /* 11 bits at 2400 baud */
enum { SENT_MOST = 4096, KEPT_MOST = 4096 };

static struct {
    uint64_t until; /* time at which the next command is read */
    bool replies, brings, wrong;
    uint8_t brought;
    uint8_t motors; /* value of the motor port since the time `settled` */
    uint64_t settled;
    int64_t driven_a, driven_c; /* driven time of motors A and C in states, forward minus backward */
    uint8_t sent[SENT_MOST];
    uint16_t sent_size;
    uint16_t kept_at;
    uint64_t kept[KEPT_MOST];
    uint16_t kept_size;
} console;

static int direction(unsigned forward, unsigned backward)
{
    return (forward != 0) - (backward != 0);
}

/* A motor with both bits set is shorted; with no bit set it floats. */
static void settle_motors(void)
{
    const int64_t states = (int64_t)(chip.now - console.settled);

    console.driven_a += states * direction(console.motors & 0x80, console.motors & 0x40);
    console.driven_c += states * direction(console.motors & 0x02, console.motors & 0x01);
    console.motors = chip.memory[MOTORS];
    console.settled = chip.now;
}

static void take_sent(uint8_t byte)
{
    if (console.sent_size < SENT_MOST)
        console.sent[console.sent_size++] = byte;
}

static void write_number(uint64_t number, int size)
{
    while (size-- > 0)
        putchar((int)(number >> 8 * size & 0xFF));
}

static void reply(void)
{
    settle_motors();
    write_number((uint64_t)(console.driven_a / STATES_A_US), 4);
    write_number((uint64_t)(console.driven_c / STATES_A_US), 4);
    write_number(console.sent_size, 2);
    fwrite(console.sent, 1, console.sent_size, stdout);
    console.driven_a = console.driven_c = 0;
    console.sent_size = 0;
}

static uint16_t read_number(int size)
{
    uint16_t number = 0;

    while (size-- > 0) {
        const int byte = getchar();

        if (byte == EOF)
            exit(0);
        number = (uint16_t)(number << 8 | byte);
    }
    return number;
}

/* A held button pulls its pin down. */
static void hold(uint8_t keys)
{
    chip.memory[PORT4] = (uint8_t)((chip.memory[PORT4] & ~6) | (keys & 1 ? 0 : 2) | (keys & 2 ? 0 : 4));
    chip.memory[PORT7] = (uint8_t)((keys & 4 ? 0 : 0x40) | (keys & 8 ? 0 : 0x80));
}

static void set_analogue(uint8_t input, uint16_t raw)
{
    chip.analogue[input == 0 ? 3 : (3 - input) & 3] =
        raw & 1023; /* channels 0 to 3 are inputs 3, 2, 1 and the battery */
}

static void write_memory(uint16_t at, uint16_t size)
{
    while (size-- > 0)
        putchar(chip.memory[at++]);
}

static void write_kept(void)
{
    write_number(console.kept_size, 2);
    for (uint16_t i = 0; i < console.kept_size; i++)
        write_number(console.kept[i], 8);
    console.kept_size = 0;
}

static void write_tally(void)
{
    write_number(chip.now, 8);
    for (int kind = 0; kind < KINDS; kind++) {
        write_number(chip.count[kind], 4);
        write_number(chip.spent[kind], 8);
    }
}

/* The host waits at the socket, and sends nothing until the copy connects: so this process has no unread command. */
static void copy_itself(void)
{
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    const uint16_t size = read_number(1);
    int end;

    for (uint16_t i = 0; i < size && i + 1U < sizeof to.sun_path; i++)
        to.sun_path[i] = (char)read_number(1);
    fflush(stdout);
    signal(SIGCHLD, SIG_IGN);
    if (fork() != 0)
        return;
    end = socket(AF_UNIX, SOCK_STREAM, 0);
    if (end < 0 || connect(end, (const struct sockaddr *)&to, sizeof to) != 0)
        exit(7);
    dup2(end, STDIN_FILENO);
    dup2(end, STDOUT_FILENO);
}

/* Carries out a command. Returns false if time has to pass before the next command. */
static bool obey(int command)
{
    switch (command) {
    case 'r':
        console.until += (uint64_t)read_number(2) * STATES_A_MS;
        console.replies = true;
        return false;
    case 'l':
        console.brought = (uint8_t)read_number(1);
        console.wrong = read_number(1) != 0;
        console.until += LINE_BYTE;
        console.replies = console.brings = true;
        return false;
    case 'k':
        hold((uint8_t)read_number(1));
        break;
    case 'a': {
        const uint8_t input = (uint8_t)read_number(1);
        set_analogue(input, read_number(2));
        break;
    }
    case 'm': {
        const uint16_t at = read_number(2);
        write_memory(at, read_number(2));
        break;
    }
    case 'b':
        console.kept_at = read_number(2);
        break;
    case 'e':
        write_kept();
        break;
    case 't':
        write_tally();
        break;
    case 'f':
        copy_itself();
        break;
    case EOF:
        exit(0);
    default:
        exit(5);
    }
    return true;
}

/* Records the time if `pc` is the address that command b has set. */
static void keep_time(uint16_t pc)
{
    if (pc == console.kept_at && console.kept_size < KEPT_MOST)
        console.kept[console.kept_size++] = chip.now;
}

/* Replies and takes commands, if the time `until` has come. */
static void console_poll(void)
{
    if (chip.memory[MOTORS] != console.motors)
        settle_motors();
    if (chip.now < console.until)
        return;
    if (console.brings)
        chip_receive(console.brought, console.wrong);
    if (console.replies)
        reply();
    console.brings = console.replies = false;
    do
        fflush(stdout);
    while (obey(getchar()));
}

#endif
