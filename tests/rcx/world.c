#include "world.h"

#include <conio.h>
#include <dkey.h>
#include <dmotor.h>
#include <dsensor.h>
#include <sys/h8.h>
#include <sys/irq.h>
#include <sys/lnp-logical.h>
#include <sys/lnp.h>
#include <sys/program.h>
#include <sys/time.h>
#include <sys/tm.h>
#include <stdlib.h>
#include <unistd.h>

/* These names are in brickOS's linker script, not in its headers for programs. */
extern char bss_start[], end[], dm_handler[], clock_handler[], dkey_handler[], rx_handler[];
extern volatile unsigned char motor_controller;
void mm_init(void);
void dm_init(void);
void ds_init(void);

enum {
    POP_R6 = 0x6d76,
    RETURN_FROM_INTERRUPT = 0x5670,
    MOTORS_HANDLER_SIZE = 0x48,
    STACK = 1024,
    QUIET_MS = 300,
    AIR = 200
};

uint16_t world_room;
static uint8_t air[AIR]; /* sent by the brick, not yet received */
static uint8_t air_size;
static bool disturbed;

/* Only the ROM's return from an interrupt is called: by a task's first run and by yield(). */
static void make_rom(void)
{
    static volatile uint16_t *const ocia_return = (uint16_t *)0x04d4;

    ocia_return[0] = POP_R6;
    ocia_return[1] = RETURN_FROM_INTERRUPT;
}

/* Moves the motors' handler, as the kernel's start does: it lies where the kernel's variables will be. */
static void move_motors_handler(void)
{
    for (uint8_t i = 0; i < MOTORS_HANDLER_SIZE; i++)
        dm_handler[i] = bss_start[i];
}

static uint16_t largest_block(void)
{
    uint16_t size = 0;
    for (uint16_t bit = 0x4000; bit > 1; bit >>= 1) {
        void *const block = malloc(size + bit);
        if (block != 0) {
            size += bit;
            free(block);
        }
    }
    return size;
}

static void boot_kernel(void)
{
    for (char *at = bss_start; at < end; at++)
        *at = 0;
    mm_init();
    systime_init();
    dm_init();
    ds_init();
    lnp_init();
    lnp_logical_init();
    tm_init();
}

static int begin(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    world_exit(world_main());
    return 0;
}

void world_boot(void)
{
    make_rom();
    move_motors_handler();
    boot_kernel();
    program_init();
    world_room = largest_block();
    boot_kernel(); /* once more, without the tasks that download and start programs */
    (void)execi(&begin, 0, 0, PRIO_NORMAL, STACK);
    tm_start();
    world_exit(3);
}

void world_convert(uint8_t input, uint16_t raw)
{
    volatile unsigned *const converter = input == 0   ? &BATTERY
                                         : input == 1 ? &SENSOR_1
                                         : input == 2 ? &SENSOR_2
                                                      : &SENSOR_3;
    *converter = raw << 6;
}

void world_press(uint8_t keys)
{
    PORT4 = (unsigned char)((keys & KEY_ONOFF ? 0 : 2) | (keys & KEY_RUN ? 0 : 4));
    PORT7 = (unsigned char)((keys & KEY_VIEW ? 0 : 0x40) | (keys & KEY_PRGM ? 0 : 0x80));
}

/* Lets the time of one byte pass on the line. True if the brick has sent a byte; it receives that byte itself. */
static bool line(uint8_t *sent)
{
    if ((S_CR & SCR_TX_IRQ) != 0) {
        S_SR = (unsigned char)(S_SR | SSR_TRANS_EMPTY);
        world_interrupt(txi_vector);
        if ((S_CR & SCR_TX_IRQ) == 0)
            return false;
        *sent = S_TDR;
        S_RDR = disturbed ? (unsigned char)~S_TDR : S_TDR;
        world_interrupt(rxi_vector);
        return true;
    }
    if ((S_CR & SCR_TE_IRQ) != 0)
        world_interrupt(tei_vector);
    return false;
}

static void pass_byte(void)
{
    uint8_t sent;

    if (line(&sent)) {
        disturbed = false;
        if (air_size < AIR)
            air[air_size++] = sent;
    }
}

void world_run(uint16_t ms)
{
    static bool second; /* buttons and motors have a timer of 2 ms */

    while (ms-- > 0) {
        world_interrupt(clock_handler);
        pass_byte();
        second = !second;
        if (second) {
            world_interrupt(dkey_handler);
            world_interrupt(dm_handler);
        }
        yield();
    }
}

void world_converted(void)
{
    for (uint8_t i = 0; i < 12; i++) /* three readings of each of four channels */
        world_interrupt(ad_vector);
}

void world_pulses(int16_t *a, int16_t *c)
{
    *a = *c = 0;
    for (uint16_t tick = 0; tick < 256; tick++) {
        world_interrupt(dm_handler);
        *a += (motor_controller & 0xC0) == 0x80 ? 1 : (motor_controller & 0xC0) == 0x40 ? -1 : 0;
        *c += (motor_controller & 0x03) == 0x02 ? 1 : (motor_controller & 0x03) == 0x01 ? -1 : 0;
    }
}

void world_send(const uint8_t *bytes, uint8_t size)
{
    for (uint8_t i = 0; i < size; i++) {
        S_RDR = bytes[i];
        world_interrupt(rx_handler);
    }
}

static void drop(uint8_t size)
{
    air_size = (uint8_t)(air_size - size);
    for (uint8_t i = 0; i < air_size; i++)
        air[i] = air[i + size];
}

/* Size of the first whole packet, 0 if there is none. Drops packets that a collision has cut short. */
static uint8_t whole_packet(void)
{
    while (air_size > 0) {
        uint8_t sum = 0xFF;

        if (air[0] == 0xF1) {
            if (air_size < 2 || air_size < air[1] + 3)
                return 0;
            for (int16_t i = 0; i < air[1] + 2; i++)
                sum = (uint8_t)(sum + air[i]);
            if (sum == air[air[1] + 2])
                return (uint8_t)(air[1] + 3);
        }
        drop(1);
    }
    return 0;
}

uint8_t world_receive(uint8_t *bytes, uint8_t most)
{
    uint8_t size = whole_packet();

    for (uint16_t quiet_ms = 0; size == 0 && quiet_ms < QUIET_MS; quiet_ms++) {
        world_run(1);
        size = whole_packet();
    }
    if (size == 0) {
        air_size = 0; /* these bytes will never be a whole packet */
        return 0;
    }
    for (uint8_t i = 0; i < size && i < most; i++)
        bytes[i] = air[i];
    drop(size);
    return size <= most ? size : 0;
}

void world_disturb(void)
{
    disturbed = true;
}

bool world_waits(void)
{
    return air_size > 0;
}

void world_forget(void)
{
    air_size = 0;
}

void world_say(const char *text)
{
    uint16_t size = 0;
    while (text[size] != '\0')
        size++;
    (void)world_write(1, text, size);
}

void world_say_number(uint16_t number)
{
    char digits[6];
    uint8_t at = sizeof digits;

    digits[--at] = '\0';
    do {
        uint16_t tens = 0;
        for (; number >= 10; number -= 10)
            tens++;
        digits[--at] = (char)('0' + number);
        number = tens;
    } while (number > 0);
    world_say(&digits[at]);
}
