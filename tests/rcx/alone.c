/* alone.c: brickOS's kernel alone, as after the download of the firmware. It starts where LEGO's ROM starts it, has all of its memory, and
 * gets its interrupts by its own vectors. Commands on the simulator's standard input control its surroundings; numbers are big-endian:
 *
 *   r ms(2)                time passes, up to 1000 ms
 *   l byte wrong           the line brings the brick a byte, in the time of a byte; wrong, not 0: with a wrong parity
 *   k keys                 these buttons are held, KEY_ bits
 *   a input raw(2)         sets the converter's reading, as world_convert()
 *   m address(2) size(2)   the reply is the content of the memory there
 *
 * The reply to r and l is: the pulses of motors A and C in that time, forward less backward (2 bytes each), the number of bytes that the
 * brick has sent (1 byte), and those bytes. The program ends at the end of its input.
 *
 * This program takes the place of the kernel's task that animates the little man. That task has the lowest priority but one; the lowest
 * one sleeps, which would end the simulator. So time passes, and interrupts come, only while all other tasks wait.
 */
#include "world.h"

#include <rom/registers.h>
#include <sys/h8.h>
#include <sys/irq.h>

enum {
    MOV_WORD_R6 = 0x6b06,
    CALL_R6 = 0x5d60,
    PUSH_R6 = 0x6df6,
    POP_R6 = 0x6d76,
    RETURN = 0x5470,
    RETURN_FROM_INTERRUPT = 0x5670,
    JUMP = 0x5a00,
    NO_OPERATION = 0,
    WAITS = 0x46f8, /* bne, to just before itself */
    SENT_MOST = 255,
    BYTE_MS_Q = 55, /* 11 bits at 2400 baud: 55/12 ms */
    MS_Q = 12
};

/* In rom.s. */
void rom_multiply(void);
void rom_divide(void);
void alone_begin(void);
void alone_switch_tasks(void);

void alone_world(void);
void kmain(void);
extern volatile unsigned char motor_controller;

static int16_t pulses_a, pulses_c;
static uint8_t sent[SENT_MOST];
static uint8_t sent_size;
static uint8_t until_byte_q;

/* The routines of the ROM that the kernel calls. The simulator ends where the kernel would be erased, or the brick switched off. */
static void make_rom(void)
{
    /* Called by these vectors. */
    static volatile uint16_t *const multiply = (uint16_t *)0x0054, *const divide = (uint16_t *)0x0058;
    static volatile uint16_t *const reset = (uint16_t *)0x03ae, *const dummy = (uint16_t *)0x046a;
    static volatile uint16_t *const ocia = (uint16_t *)0x04cc, *const lcd_show = (uint16_t *)0x1b62;
    static volatile uint16_t *const lcd_clear = (uint16_t *)0x27ac, *const power_init = (uint16_t *)0x2964;
    static volatile uint16_t *const power_off = (uint16_t *)0x2a62;

    *multiply = (uint16_t)&rom_multiply;
    *divide = (uint16_t)&rom_divide;
    dummy[0] = lcd_clear[0] = power_init[0] = RETURN;
    reset[0] = power_off[0] = lcd_show[0] = JUMP;
    reset[1] = power_off[1] = (uint16_t)&world_exit;
    lcd_show[1] = (uint16_t)&alone_begin;
    ocia[0] = PUSH_R6;
    ocia[1] = MOV_WORD_R6;
    ocia[2] = (uint16_t)&ocia_vector;
    ocia[3] = CALL_R6;
    ocia[4] = POP_R6;
    ocia[5] = RETURN_FROM_INTERRUPT;
}

/* Before its tasks run, the kernel waits for the On-Off button to be released, which only an interrupt tells it: the simulator has none
 * of its own. */
static void wait_for_no_button(void)
{
    volatile uint16_t *at = (volatile uint16_t *)&kmain;

    while (*at != WAITS)
        at++;
    *at = NO_OPERATION;
}

void world_boot(void)
{
    make_rom();
    wait_for_no_button();
    world_press(0);
    kmain();
    world_exit(3);
}

/* True if the time of a byte is over. */
static bool line_is_due(void)
{
    until_byte_q = (uint8_t)(until_byte_q + MS_Q);
    if (until_byte_q < BYTE_MS_Q)
        return false;
    until_byte_q = (uint8_t)(until_byte_q - BYTE_MS_Q);
    return true;
}

/* Lets a ms pass, with the interrupts of the timers and the converter. True if the line is ready for a byte. */
static bool pass_ms(void)
{
    const bool line = line_is_due();

    world_interrupt(nmi_vector);
    if ((T_IER & TIER_ENABLE_OCB) != 0)
        world_interrupt(ocib_vector);
    for (uint8_t channel = 0; channel < 4; channel++)
        world_interrupt(ad_vector);
    if ((T_IER & TIER_ENABLE_OCA) != 0)
        alone_switch_tasks();
    pulses_a += (motor_controller & 0xC0) == 0x80 ? 1 : (motor_controller & 0xC0) == 0x40 ? -1 : 0;
    pulses_c += (motor_controller & 0x03) == 0x02 ? 1 : (motor_controller & 0x03) == 0x01 ? -1 : 0;
    return line;
}

static void run(uint16_t ms)
{
    uint8_t byte;

    while (ms-- > 0)
        if (pass_ms() && world_line(false, &byte) && sent_size < SENT_MOST)
            sent[sent_size++] = byte;
}

static void bring(uint8_t byte, bool wrong)
{
    while (!pass_ms()) {
    }
    S_RDR = byte;
    world_interrupt(wrong ? eri_vector : rxi_vector);
}

static void write_all(const void *bytes, uint16_t size)
{
    const uint8_t *at = (const uint8_t *)bytes;

    while (size > 0) {
        const int16_t written = world_write(1, at, size);

        if (written <= 0)
            world_exit(4);
        at += written;
        size -= (uint16_t)written;
    }
}

static void answer(void)
{
    write_all(&pulses_a, sizeof pulses_a);
    write_all(&pulses_c, sizeof pulses_c);
    write_all(&sent_size, sizeof sent_size);
    write_all(sent, sent_size);
    pulses_a = pulses_c = 0;
    sent_size = 0;
}

/* Reads the next number of the input, of one or two bytes. */
static uint16_t next(uint8_t size)
{
    uint8_t byte;
    uint16_t number = 0;

    while (size-- > 0) {
        if (world_read(0, &byte, 1) != 1)
            world_exit(0);
        number = (uint16_t)(number << 8 | byte);
    }
    return number;
}

void alone_world(void)
{
    for (;;) {
        const uint8_t command = (uint8_t)next(1);
        const uint16_t first = next(command == 'r' || command == 'm' ? 2 : 1);

        if (command == 'r') {
            run(first);
            answer();
        } else if (command == 'l') {
            bring((uint8_t)first, next(1) != 0);
            answer();
        } else if (command == 'k') {
            world_press((uint8_t)first);
        } else if (command == 'a') {
            world_convert((uint8_t)first, next(2));
        } else if (command == 'm') {
            write_all((const void *)first, next(2));
        } else {
            world_exit(5);
        }
    }
}
