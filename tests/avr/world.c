/* world CHIP PROGRAM.elf MAILBOX: runs a test program on simavr's chip, with the board of sim_host/avr round it, and does what the program
 * asks for in its mailbox, which is at address MAILBOX (hexadecimal) of its memory. What it writes to GPIOR2 goes to standard output.
 * The exit status is what it wrote to GPIOR0 before it slept with interrupts off; 124 if it has not done so within a minute of its
 * time.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "avr/chip.h"
#include "mailbox.h"

enum { GPIOR0 = 0x3E, GPIOR1 = 0x4A, GPIOR2 = 0x4B };
enum { ENDLESS = 124, BAD_USE = 2, MS = CHIP_HZ / 1000, MOST_MS = 60000, MEASURED = 64 * 1024 };

typedef struct {
    chip_t chip;
    mailbox_t *mailbox; /* in the chip's memory */
    int64_t counts[SIDES];
    uint32_t resets;                    /* up to the ms before */
    bridge_state_t in_ms[SIDES];        /* what the drives did at the end of the ms before */
    bridge_state_t before_reset[SIDES]; /* ... at the end of the last ms before the newest reset */
} world_t;

/* Shows a reading of `raw` counts: the volts in its middle. */
static void show(world_t *world)
{
    static const int WHICH[MAILBOX_INPUTS] = {ANALOG_GYRO, ANALOG_SURGE, ANALOG_SWAY, ANALOG_BATTERY};

    for (int i = 0; i < MAILBOX_INPUTS; i++)
        world->chip.volts[WHICH[i]] = (world->mailbox->raw[i] + 0.5) * 5 / 1024;
    for (int kind = 0; kind < I2C_IMUS; kind++)
        world->chip.imu[kind].motion = (i2c_motion_t){.yaw = world->mailbox->motion[0] * 1e-3,
                                                      .surge = world->mailbox->motion[1] * 1e-3,
                                                      .sway = world->mailbox->motion[2] * 1e-3};
    if (world->mailbox->imu_unpowered != (world->chip.fault[CHIP_IMU_UNPOWERED] > 0))
        chip_set_fault(&world->chip, CHIP_IMU_UNPOWERED, world->mailbox->imu_unpowered);
    for (int side = 0; side < SIDES; side++)
        world->counts[side] += (int16_t)(world->mailbox->counts[side] - (uint16_t)world->counts[side]);
}

static int16_t parts_of(const bridge_t *bridge)
{
    return (int16_t)lround(1024 * bridge_duty(bridge));
}

static avr_cycle_count_t end_measurement(avr_t *avr, avr_cycle_count_t when, void *param)
{
    world_t *world = param;

    (void)avr;
    for (int side = 0; side < SIDES; side++) {
        bridge_count(&world->chip.bridge[side], when);
        world->mailbox->parts[side] = parts_of(&world->chip.bridge[side]);
    }
    return 0;
}

static void begin_measurement(world_t *world)
{
    for (int side = 0; side < SIDES; side++) {
        bridge_count(&world->chip.bridge[side], world->chip.avr->cycle);
        bridge_clear(&world->chip.bridge[side]);
    }
    avr_cycle_timer_register(world->chip.avr, MEASURED, end_measurement, world);
}

static void send(world_t *world)
{
    for (int i = 0; i < world->mailbox->size; i++)
        (void)queue_put(&world->chip.in, world->mailbox->bytes[i]);
    line_send(&world->chip);
}

/* At most as many as the mailbox asks for. */
static void receive(world_t *world)
{
    uint8_t got = 0;

    while (got < world->mailbox->size && queue_take(&world->chip.out, &world->mailbox->bytes[got]))
        got++;
    world->mailbox->size = got;
}

static void tell(world_t *world)
{
    for (int side = 0; side < SIDES; side++) {
        world->mailbox->parts[side] = (int16_t)world->chip.bridge[side].state;
        world->mailbox->bytes[side] = (uint8_t)world->before_reset[side];
    }
    world->mailbox->size = (uint8_t)world->chip.overruns;
    world->mailbox->resets = (uint8_t)world->chip.resets;
}

static void on_request(avr_t *avr, avr_io_addr_t address, uint8_t request, void *param)
{
    world_t *world = param;

    avr->data[address] = request;
    switch (request) {
    case WORLD_SHOW:
        show(world);
        break;
    case WORLD_MEASURE:
        begin_measurement(world);
        break;
    case WORLD_SEND:
        send(world);
        break;
    case WORLD_RECEIVE:
        receive(world);
        break;
    case WORLD_FAULT:
        chip_set_fault(&world->chip, (chip_fault_t)world->mailbox->fault, world->mailbox->size);
        break;
    case WORLD_TELL:
        tell(world);
        break;
    default:
        break;
    }
}

static void on_text(avr_t *avr, avr_io_addr_t address, uint8_t byte, void *param)
{
    (void)avr;
    (void)address;
    (void)param;
    putchar(byte);
}

static void remember_drives(world_t *world)
{
    if (world->resets != world->chip.resets)
        memcpy(world->before_reset, world->in_ms, sizeof world->before_reset);
    world->resets = world->chip.resets;
    for (int side = 0; side < SIDES; side++)
        world->in_ms[side] = world->chip.bridge[side].state;
}

/* A ms begins: the wheels turn to where they are to be, at a steady rate. */
static void on_ms(void *owner)
{
    world_t *world = owner;

    remember_drives(world);
    for (int side = 0; side < SIDES; side++) {
        const double from = (double)world->chip.encoder[side].count + 0.5, to = (double)world->counts[side] + 0.5;
        const quadrature_track_t track = {
            .counts = {from, to}, .rate = {1e3 * (to - from), 1e3 * (to - from)}, .seconds = 1e-3, .cycles = MS};
        chip_turn(&world->chip, side, &track);
    }
}

static int run(world_t *world, const wiring_t *wiring, const char *program, unsigned long mailbox)
{
    if (chip_open(&world->chip, wiring, program, NULL) != CHIP_OK)
        return BAD_USE;
    world->mailbox = (mailbox_t *)(void *)(world->chip.avr->data + mailbox);
    avr_register_io_write(world->chip.avr, GPIOR1, on_request, world);
    avr_register_io_write(world->chip.avr, GPIOR2, on_text, world);
    chip_every(&world->chip, MS, on_ms, world);
    for (int ms = 0; ms < MOST_MS; ms++) {
        chip_run_step(&world->chip);
        if (chip_has_stopped(&world->chip))
            return world->chip.avr->data[GPIOR0];
    }
    return ENDLESS;
}

int main(int argc, char **argv)
{
    static world_t world;
    const wiring_t *const wiring = argc > 1 && strcmp(argv[1], WIRING_328P.chip) == 0 ? &WIRING_328P : &WIRING_2560;
    const int status = argc == 4 ? run(&world, wiring, argv[2], strtoul(argv[3], NULL, 16) & 0xFFFFU) : BAD_USE;

    chip_close(&world.chip);
    return status;
}
