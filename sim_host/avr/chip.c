#include "avr/chip.h"

#include <fcntl.h>
#include <gelf.h>
#include <libelf.h>
#include <simavr/sim_core.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_hex.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { RUN_AT_MOST = 1000 };
static const double REGULATOR_DROP_V = 0.5, REGULATED_V = 5.0, NEEDED_AT_16_MHZ_V = 3.8;

/* Drops simavr's messages: chip.h reports errors as a status. */
static void say_nothing(avr_t *avr, const int level, const char *format, va_list values)
{
    (void)avr;
    (void)level;
    (void)format;
    (void)values;
}

/* Without this function simavr sleeps in real time. */
static void do_not_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    (void)cycles;
}

static bool main_runs(const avr_t *avr)
{
    return avr->interrupts.running_ptr == 0 && avr->sreg[S_I] && avr->state == cpu_Running;
}

/* Replaces the main program's next instruction by a jump to itself: only the time of the jump passes. */
static void stand_still(avr_t *avr)
{
    avr->cycle += 2;
    avr_cycle_timer_process(avr);
    if (avr->interrupt_state)
        avr_service_interrupts(avr);
}

static chip_t *chip_of(avr_t *avr)
{
    return avr->custom.data;
}

static void look(chip_t *chip, bool asleep)
{
    const avr_t *avr = chip->avr;
    const uint16_t stack = (uint16_t)(avr->data[R_SPL] | avr->data[R_SPH] << 8);

    profile_look(chip->profile, avr->cycle, avr->pc, stack, asleep);
}

/* True also before a SLEEP instruction: simavr begins to sleep in the call that executes it. */
static bool sleeps(const avr_t *avr)
{
    enum { SLEEP_LOW = 0x88, SLEEP_HIGH = 0x95 };
    return avr->state == cpu_Sleeping || (avr->flash[avr->pc] == SLEEP_LOW && avr->flash[avr->pc + 1] == SLEEP_HIGH);
}

static void run(avr_t *avr)
{
    chip_t *chip = chip_of(avr);
    const bool asleep = sleeps(avr);

    if (chip->fault[CHIP_INTERRUPT_STUCK] > 0)
        avr_raise_interrupt(avr, &chip->adc->adc);
    if (chip->fault[CHIP_MAIN_HELD] > 0 && main_runs(avr))
        stand_still(avr);
    else
        avr_callback_run_raw(avr);
    if (chip->profile != NULL)
        look(chip, asleep);
}

/* simavr may run many instructions in a call, up to its next timer. If a fault or a profile checks each instruction, it
 * runs one. */
static void choose_stride(chip_t *chip)
{
    const bool each = chip->fault[CHIP_INTERRUPT_STUCK] > 0 || chip->fault[CHIP_MAIN_HELD] > 0 || chip->profile != NULL;
    chip->avr->run_cycle_limit = each ? 1 : RUN_AT_MOST;
}

static avr_cycle_count_t step(avr_t *avr, avr_cycle_count_t when, void *param)
{
    chip_t *chip = param;

    (void)avr;
    for (int side = 0; side < SIDES; side++)
        bridge_count(&chip->bridge[side], when);
    chip->next_step = when + chip->step_cycles;
    line_keep_time(chip);
    chip->on_step(chip->owner);
    return chip->next_step;
}

static void await(chip_t *chip, uint64_t cycle, avr_cycle_timer_t timer, void *param)
{
    const uint64_t now = chip->avr->cycle;
    avr_cycle_timer_register(chip->avr, cycle > now ? cycle - now : 0, timer, param);
}

static avr_cycle_count_t turn(avr_t *avr, avr_cycle_count_t when, void *param)
{
    chip_encoder_t *encoder = param;
    const quadrature_track_t *track = &encoder->track;
    uint32_t after;
    int way;

    (void)avr;
    if (quadrature_next(track, encoder->count, &way) != 0) {
        encoder->count += way;
        pins_encoder(encoder->chip, encoder->side);
    }
    after = quadrature_next(track, encoder->count, &way);
    return after == 0 ? 0 : encoder->began + after > when ? encoder->began + after : when + 1;
}

void chip_turn(chip_t *chip, int side, const quadrature_track_t *track)
{
    chip_encoder_t *encoder = &chip->encoder[side];
    uint32_t after;
    int way;

    encoder->track = *track;
    encoder->began = chip->next_step - chip->step_cycles;
    avr_cycle_timer_cancel(chip->avr, turn, encoder);
    after = quadrature_next(track, encoder->count, &way);
    if (after != 0)
        await(chip, encoder->began + after, turn, encoder);
}

/* simavr's reset removes all its timers, even those of this file. */
static void after_reset(avr_io_t *hook)
{
    chip_t *chip = chip_of(hook->avr);
    int way;

    if (chip->on_step == NULL) /* the reset of power-on */
        return;
    chip->resets++;
    choose_stride(chip);
    pins_after_reset(chip);
    line_send(chip);
    await(chip, chip->next_step, step, chip);
    for (int side = 0; side < SIDES; side++) {
        chip_encoder_t *encoder = &chip->encoder[side];
        const uint32_t after = quadrature_next(&encoder->track, encoder->count, &way);
        if (after != 0)
            await(chip, encoder->began + after, turn, encoder);
    }
    pins_make_noise(chip);
}

/* Finds a device of simavr by its kind and, unless `name` is 0, by the name that follows its avr_io_t head. */
static void *device(avr_t *avr, const char *kind, char name)
{
    for (avr_io_t *io = avr->io_port; io != NULL; io = io->next)
        if (strcmp(io->kind, kind) == 0 && (name == 0 || ((const avr_uart_t *)io)->name == name))
            return io;
    return NULL;
}

static void find_devices(chip_t *chip)
{
    for (char name = 'A'; name <= 'Z'; name++)
        for (avr_io_t *io = chip->avr->io_port; io != NULL; io = io->next)
            if (strcmp(io->kind, "port") == 0 && ((avr_ioport_t *)io)->name == name)
                chip->port[name - 'A'] = (avr_ioport_t *)io;
    chip->pwm_timer = device(chip->avr, "timer", '1');
    chip->uart = device(chip->avr, "uart", '0');
    chip->adc = device(chip->avr, "adc", 0);
    chip->twi = device(chip->avr, "twi", 0);
}

static void forget(elf_firmware_t *firmware)
{
    for (uint32_t i = 0; i < firmware->symbolcount; i++)
        free(firmware->symbol[i]);
    free(firmware->symbol);
    free(firmware->flash);
    free(firmware->eeprom);
    free(firmware->fuse);
}

/* simavr reads any file as ELF. This function checks that the file is ELF, for an AVR. */
static bool is_avr_elf(const char *file)
{
    static const unsigned char MAGIC[] = {0x7F, 'E', 'L', 'F', ELFCLASS32, ELFDATA2LSB};
    unsigned char head[20] = {0};
    const int fd = open(file, O_RDONLY);
    const bool whole = fd >= 0 && read(fd, head, sizeof head) == (ssize_t)sizeof head;

    if (fd >= 0)
        close(fd);
    return whole && memcmp(head, MAGIC, sizeof MAGIC) == 0 && head[18] == EM_AVR;
}

/* The address where a reset begins: 0, or the start of the boot section if the fuse BOOTRST is programmed (reads as 0).
 * Each step of BOOTSZ halves the section, from its largest size. ATmega328P datasheet, tables 27-7 and 28-6;
 * ATmega2560, tables 29-13 and 30-4. */
static avr_flashaddr_t reset_address(const avr_t *avr, uint32_t largest_boot_section)
{
    enum { HIGH = 1, BOOTRST = 1, BOOTSZ_AT = 1, BOOTSZ_MASK = 3 };
    const uint8_t high = avr->fuse[HIGH];

    if ((high & BOOTRST) != 0)
        return 0;
    return avr->flashend + 1 - (largest_boot_section >> ((high >> BOOTSZ_AT) & BOOTSZ_MASK));
}

static chip_status_t load(chip_t *chip, const char *image)
{
    elf_firmware_t firmware = {0};
    chip_status_t status = CHIP_OK;

    if (!is_avr_elf(image) || elf_read_firmware(image, &firmware) != 0 || firmware.flashsize == 0)
        return CHIP_BAD_IMAGE;
    if (firmware.flashbase + firmware.flashsize > chip->avr->flashend + 1) {
        status = CHIP_TOO_LARGE;
    } else {
        memset(chip->avr->fuse, 0xFF, sizeof chip->avr->fuse);
        avr_load_firmware(chip->avr, &firmware);
        chip->avr->pc = chip->avr->reset_pc = reset_address(chip->avr, chip->wiring->largest_boot_section);
    }
    forget(&firmware);
    return status;
}

static void connect_hook(chip_t *chip)
{
    chip->hook = (avr_io_t){.kind = "brickpilot", .reset = after_reset};
    avr_register_io(chip->avr, &chip->hook);
}

chip_status_t chip_open(chip_t *chip, const wiring_t *wiring, const char *image, const char *trace)
{
    chip_status_t status;

    avr_global_logger_set(say_nothing);
    *chip = (chip_t){.wiring = wiring, .supply_v = REGULATED_V};
    chip->avr = avr_make_mcu_by_name(wiring->chip);
    if (chip->avr == NULL)
        return CHIP_UNKNOWN;
    avr_init(chip->avr);
    status = load(chip, image);
    if (status != CHIP_OK)
        return status;
    chip->avr->frequency = CHIP_HZ;
    chip->avr->vcc = chip->avr->avcc = chip->avr->aref = (uint32_t)(REGULATED_V * 1e3);
    chip->avr->custom.data = chip;
    chip->avr->sleep = do_not_sleep;
    chip->avr->run = run;
    random_start(&chip->random, 1);
    find_devices(chip);
    connect_hook(chip);
    pins_connect(chip);
    line_connect(chip);
    for (int kind = 0; kind < I2C_IMUS; kind++)
        i2c_imu_connect(&chip->imu[kind], (i2c_imu_kind_t)kind, chip->twi);
    choose_stride(chip);
    return trace == NULL || trace_open(chip, trace) ? CHIP_OK : CHIP_BAD_TRACE;
}

void chip_every(chip_t *chip, uint32_t step_cycles, void (*on_step)(void *owner), void *owner)
{
    chip->step_cycles = step_cycles;
    chip->on_step = on_step;
    chip->owner = owner;
    chip->next_step = chip->avr->cycle + step_cycles;
    await(chip, chip->next_step, step, chip);
}

void chip_close(chip_t *chip)
{
    if (chip->avr == NULL)
        return;
    trace_close(chip);
    avr_terminate(chip->avr);
    free(chip->avr);
    chip->avr = NULL;
}

bool chip_has_stopped(const chip_t *chip)
{
    return chip->avr->state != cpu_Running && chip->avr->state != cpu_Sleeping;
}

/* Lets time pass without instructions; timers go on. */
static void idle(avr_t *avr)
{
    const avr_cycle_count_t cycles = avr_cycle_timer_process(avr);
    if (avr->cycle_timers.timer != NULL && avr->cycle_timers.timer->when > avr->cycle)
        avr->cycle += cycles;
}

void chip_run_step(chip_t *chip)
{
    avr_t *avr = chip->avr;
    const uint64_t end = chip->next_step;

    while (chip->next_step == end) {
        if (avr->run == run && (chip->unpowered || chip->fault[CHIP_RESET_PIN] > 0 || chip_has_stopped(chip)))
            idle(avr);
        else
            avr->run(avr); /* our run(), or simavr's own function for a reset by the watchdog */
    }
}

/* The brown-out detector's level in V, from the three low bits of the extended fuse byte; 0: the detector is off. */
static double brown_out_level(const avr_t *avr)
{
    static const double LEVELS[] = {0, 0, 0, 0, 4.3, 2.7, 1.8, 0};
    return LEVELS[avr->fuse[2] & 7];
}

void chip_supply(chip_t *chip, double battery_v)
{
    avr_t *avr = chip->avr;
    const double given = battery_v - REGULATOR_DROP_V;
    const double volts = given > REGULATED_V ? REGULATED_V : given > 0 ? given : 0;
    const double level = brown_out_level(avr);
    const bool detected = volts < level;
    const bool was_unpowered = chip->unpowered;

    chip->supply_v = volts;
    avr->vcc = avr->avcc = (uint32_t)(volts * 1e3) > 0 ? (uint32_t)(volts * 1e3) : 1;
    chip->unpowered = detected || volts < (level > 0 ? 0 : NEEDED_AT_16_MHZ_V);
    if (detected && !was_unpowered)
        avr_reset(avr);
    if (was_unpowered && !chip->unpowered && level > 0)
        avr_regbit_set(avr, avr->reset_flags.borf);
    trace_reset(chip, detected);
}

void chip_profile(chip_t *chip, profile_t *profile)
{
    profile->lowest_stack = UINT16_MAX;
    profile->now = chip->avr->cycle;
    chip->profile = profile;
    choose_stride(chip);
}

/* A low reset pin resets the processor. When the pin is high again, the processor's flags name it as the cause. */
static void pull_reset_pin(chip_t *chip, bool low)
{
    if (low)
        avr_reset(chip->avr);
    else
        avr_regbit_set(chip->avr, chip->avr->reset_flags.extrf);
}

static const avr_regbit_t NEVER = {.reg = 0};

/* While the data line is held low, the chip's own I2C device waits: this function hides the enable bit from the
 * device. */
static void hold_bus(chip_t *chip, bool held)
{
    if (held == (chip->twi->twen.reg == 0))
        return;
    chip->clocks = 0;
    if (held) {
        chip->bus_enable = chip->twi->twen;
        chip->twi->twen = NEVER;
    } else {
        chip->twi->twen = chip->bus_enable;
    }
}

void chip_clock_bus(chip_t *chip, bool low)
{
    enum { CLOCKS = 9 };

    chip->clocks += chip->clock_was_low && !low;
    chip->clock_was_low = low;
    if (chip->fault[CHIP_BUS_HELD] > 0 && chip->clocks >= CLOCKS)
        chip_set_fault(chip, CHIP_BUS_HELD, 0);
}

void chip_set_fault(chip_t *chip, chip_fault_t fault, double value)
{
    const bool was_stuck = chip->fault[CHIP_CONVERTER_STUCK] > 0;

    if (fault == CHIP_RESET_PIN && (value > 0) != (chip->fault[fault] > 0))
        pull_reset_pin(chip, value > 0);
    chip->fault[fault] = value;
    choose_stride(chip);
    if (!was_stuck && chip->fault[CHIP_CONVERTER_STUCK] > 0) {
        chip->converter_enable = chip->adc->aden; /* simavr checks this bit at the end of a conversion */
        chip->adc->aden = NEVER;
    } else if (was_stuck && !(chip->fault[CHIP_CONVERTER_STUCK] > 0)) {
        chip->adc->aden = chip->converter_enable;
    }
    if (fault == CHIP_ENCODER_NOISE)
        pins_make_noise(chip);
    for (int kind = 0; fault == CHIP_IMU_UNPOWERED && kind < I2C_IMUS; kind++)
        i2c_imu_power(&chip->imu[kind], !(value > 0));
    if (fault == CHIP_BUS_HELD)
        hold_bus(chip, value > 0);
}

bool queue_put(chip_queue_t *queue, uint8_t byte)
{
    if (queue->size == LINE_ROOM)
        return false;
    queue->bytes[(queue->first + queue->size++) % LINE_ROOM] = byte;
    return true;
}

bool queue_take(chip_queue_t *queue, uint8_t *byte)
{
    if (queue->size == 0)
        return false;
    *byte = queue->bytes[queue->first];
    queue->first = (queue->first + 1) % LINE_ROOM;
    queue->size--;
    return true;
}
