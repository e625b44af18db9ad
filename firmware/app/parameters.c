#include "app/parameters.h"

#include <stddef.h>

#include "app/settings_gen.h"
#include "core/bytes.h"
#include "core/fix.h"
#include "wire/codecs_gen.h"
#include "wire/message.h"

typedef struct {
    int16_t low;
    uint16_t span; /* the largest value minus `low` */
} range_t;

typedef struct {
    uint8_t at; /* offset of the setting in parameters_t, bytes */
    unsigned size : 3;
    unsigned range : 4;
    unsigned at_rest : 1; /* 1: must not be written while the robot drives */
} place_t;

#define RANGE(low, span) {low, span},
#define PLACE(field, range, at_rest)                                                                                   \
    {offsetof(parameters_t, field), sizeof(((parameters_t *)0)->field), range, at_rest},

static const FLASH range_t RANGES[] = {SETTINGS_RANGES(RANGE)};
static const FLASH place_t PLACES[] = {SETTINGS(PLACE)};
enum { PLACES_COUNT = sizeof PLACES / sizeof PLACES[0] };

void parameters_start(parameters_t *parameters, const FLASH loop_config_t *constants)
{
    bytes_copy_flash(&parameters->config, constants, sizeof *constants);
    parameters->travel_scale_q15 = 0;
    parameters->believed_travel_um_q2 = constants->step.speed.count_travel_um_q2;
}

/* Returns the corrected travel per count, `believed` * (1 + scale); saturates. */
static uint16_t scaled_travel_um_q2(uint16_t believed, int16_t scale_q15)
{
    const int32_t more = fix_mul_q15(believed, scale_q15);

    return more < 0 ? (uint16_t)(believed + (uint16_t)more) : fix_add_u16(believed, (uint16_t)more);
}

static bool within(const FLASH place_t *place, int32_t value)
{
    const FLASH range_t *const range = &RANGES[place->range];

    return place->size == sizeof value ? value > 0 : (uint32_t)value - (uint32_t)(int32_t)range->low <= range->span;
}

int32_t parameters_read(const parameters_t *parameters, uint8_t number)
{
    const FLASH place_t *place;
    const void *field;

    if (number >= PLACES_COUNT)
        return 0;
    place = &PLACES[number];
    field = (const uint8_t *)parameters + place->at;
    if (place->size == sizeof(uint8_t))
        return *(const uint8_t *)field;
    if (place->size == sizeof(int32_t))
        return *(const int32_t *)field;
    if ((uint8_t)place->range >= SETTINGS_SIGNED_RANGE)
        return *(const int16_t *)field;
    return *(const uint16_t *)field;
}

parameters_status_t parameters_write(parameters_t *parameters, uint8_t number, int32_t value, bool running)
{
    const FLASH place_t *place;
    void *field;

    if (number >= PLACES_COUNT)
        return PARAMETERS_UNKNOWN;
    place = &PLACES[number];
    field = (uint8_t *)parameters + place->at;
    if (running && place->at_rest)
        return PARAMETERS_BUSY;
    if (!within(place, value))
        return PARAMETERS_RANGE;
    if (place->size == sizeof(uint8_t))
        *(uint8_t *)field = (uint8_t)value;
    else if (place->size == sizeof(int32_t))
        *(int32_t *)field = value;
    else
        *(uint16_t *)field = (uint16_t)value;
    parameters->config.step.speed.count_travel_um_q2 =
        scaled_travel_um_q2(parameters->believed_travel_um_q2, parameters->travel_scale_q15);
    return PARAMETERS_OK;
}

parameters_status_t parameters_take(parameters_t *parameters, bool running, uint8_t *data)
{
    const uint8_t number = data[WIRE_PARAMETER_REQUEST_PARAMETER_AT] & WIRE_PARAMETER_REQUEST_PARAMETER_MASK;
    const bool writes = data[WIRE_PARAMETER_REQUEST_WRITE_AT] & 1U << WIRE_PARAMETER_REQUEST_WRITE_SHIFT;
    uint8_t *const at = &data[WIRE_PARAMETER_VALUE_AT];
    parameters_status_t status = number < PLACES_COUNT ? PARAMETERS_OK : PARAMETERS_UNKNOWN;
    int32_t value;

    if (writes) {
        message_move(&value, at, sizeof value);
        status = parameters_write(parameters, number, value, running);
    }
    value = parameters_read(parameters, number);
    message_move(at, &value, sizeof value);
    return status;
}
