/* interface.c: the functions of brickpilot_avr.h, on top of world.h. */
#include "brickpilot_avr.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "avr/world.h"

struct bp_avr {
    world_t world;
    profile_t profile;
    wiring_t wiring;
};

_Static_assert((int)BP_AVR_MAIN_HELD == (int)CHIP_MAIN_HELD &&
                   (int)BP_AVR_INTERRUPT_STUCK == (int)CHIP_INTERRUPT_STUCK &&
                   (int)BP_AVR_CONVERTER_STUCK == (int)CHIP_CONVERTER_STUCK &&
                   (int)BP_AVR_LINE_OVERRUN == (int)CHIP_LINE_OVERRUN &&
                   (int)BP_AVR_ENCODER_NOISE == (int)CHIP_ENCODER_NOISE &&
                   (int)BP_AVR_RESET_PIN == (int)CHIP_RESET_PIN &&
                   (int)BP_AVR_IMU_UNPOWERED == (int)CHIP_IMU_UNPOWERED && (int)BP_AVR_BUS_HELD == (int)CHIP_BUS_HELD &&
                   (int)BP_AVR_BATTERY == (int)CHIP_FAULTS,
               "the faults of the interface are those of the chip, and the battery");
_Static_assert((int)BP_AVR_GYRO == (int)ANALOG_GYRO && (int)BP_AVR_SURGE == (int)ANALOG_SURGE &&
                   (int)BP_AVR_SWAY == (int)ANALOG_SWAY && (int)BP_AVR_BATTERY_INPUT == (int)ANALOG_BATTERY,
               "the inputs of the interface are those of the wiring");

static const wiring_t *wiring_of(const char *chip)
{
    const wiring_t *const known[] = {&WIRING_328P, &WIRING_2560};

    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strcmp(chip, known[i]->chip) == 0)
            return known[i];
    return NULL;
}

static int opened(bp_avr *brick, const bp_flight *request, const char *image, const char *chip, const char *trace)
{
    static const int CODES[] = {[CHIP_OK] = 0,
                                [CHIP_BAD_IMAGE] = BP_AVR_E_IMAGE,
                                [CHIP_UNKNOWN] = BP_AVR_E_CHIP,
                                [CHIP_TOO_LARGE] = BP_AVR_E_TOO_LARGE,
                                [CHIP_BAD_TRACE] = BP_AVR_E_TRACE};
    const wiring_t *wiring = wiring_of(chip);
    const bool sound = request->model != NULL && request->model->vehicle == BP_DIFF_DRIVE && request->steps >= 1;

    if (!sound)
        return BP_E_RANGE;
    if (wiring == NULL)
        return BP_AVR_E_CHIP;
    brick->wiring = *wiring;
    const chip_status_t status = chip_open(&brick->world.chip, &brick->wiring, image, trace);
    return status != CHIP_OK ? CODES[status] : world_start(&brick->world, request);
}

bp_avr *bp_avr_open(const bp_flight *request, const char *image, const char *chip, const char *trace, int *status)
{
    bp_avr *brick = calloc(1, sizeof *brick);

    *status = BP_E_MEMORY;
    if (brick == NULL)
        return NULL;
    *status = opened(brick, request, image, chip, trace);
    if (*status == 0)
        return brick;
    bp_avr_close(brick);
    return NULL;
}

void bp_avr_close(bp_avr *brick)
{
    chip_close(&brick->world.chip);
    free(brick);
}

int bp_avr_scale(bp_avr *brick, int input, double per_count)
{
    if (input < 0 || input >= ANALOG_COUNT || !isfinite(per_count) || per_count == 0)
        return BP_E_RANGE;
    brick->wiring.analog[input].per_count = per_count;
    return 0;
}

int bp_avr_wait(bp_avr *brick, int motor_steps)
{
    int status = 0;

    for (int i = 0; i < motor_steps && status == 0; i++)
        status = world_pass(&brick->world);
    return status;
}

int bp_avr_fly(bp_avr *brick)
{
    return world_fly(&brick->world);
}

int bp_avr_send(bp_avr *brick, const unsigned char *bytes, int count)
{
    int sent = 0;

    while (sent < count && queue_put(&brick->world.chip.in, bytes[sent]))
        sent++;
    line_send(&brick->world.chip);
    return sent;
}

int bp_avr_receive(bp_avr *brick, unsigned char *bytes, int room)
{
    int got = 0;

    while (got < room && queue_take(&brick->world.chip.out, &bytes[got]))
        got++;
    return got;
}

int bp_avr_fault(bp_avr *brick, int fault, double value)
{
    if (fault < 0 || fault > BP_AVR_BATTERY || !(value >= 0))
        return BP_E_RANGE;
    if (fault == BP_AVR_BATTERY)
        world_set_battery(&brick->world, value);
    else
        chip_set_fault(&brick->world.chip, (chip_fault_t)fault, value);
    return 0;
}

void bp_avr_tell(const bp_avr *brick, bp_avr_report *report)
{
    const chip_t *chip = &brick->world.chip;

    *report = (bp_avr_report){.cycles = chip->avr->cycle,
                              .resets = chip->resets,
                              .overruns = chip->overruns,
                              .lost = chip->lost_out,
                              .stopped = chip_has_stopped(chip),
                              .unpowered = chip->unpowered,
                              .profiled = brick->profile.ended,
                              .stack = chip->profile == NULL ? 0 : chip->avr->ramend - brick->profile.lowest_stack,
                              .duty = {brick->world.duty[LEFT], brick->world.duty[RIGHT]}};
}

int bp_avr_profile(bp_avr *brick, const bp_avr_function *functions, int count, unsigned int vectors_end,
                   bp_avr_costs *rows, int room)
{
    if (count < 0 || count > PROFILE_FUNCTIONS || room < 0)
        return BP_E_RANGE;
    brick->profile = (profile_t){.functions = count, .vectors_end = vectors_end, .rows = rows, .room = room};
    for (int i = 0; i < count; i++) {
        if (functions[i].part < 0 || functions[i].part >= BP_AVR_PARTS)
            return BP_E_RANGE;
        brick->profile.function[i] = functions[i];
    }
    chip_profile(&brick->world.chip, &brick->profile);
    return 0;
}

int bp_avr_read(const bp_avr *brick, int address, unsigned char *bytes, int count)
{
    const avr_t *avr = brick->world.chip.avr;

    if (address < 0 || count < 0 || address > avr->ramend || count > avr->ramend + 1 - address)
        return BP_E_RANGE;
    memcpy(bytes, avr->data + address, (size_t)count);
    return 0;
}
