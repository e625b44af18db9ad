#include "app/parameters.h"

#include "states.h"
#include "vectors.h"

enum { NUMBERS = 48, RUN_WRITES = 200, ENDS = 8 };

/* Of the settings' ranges. */
static const int32_t ends[ENDS] = {0, 20, 255, 10000, 20000, 32767, 65535L, -20000};

static void hash_one(const parameters_t *parameters, uint8_t index)
{
    uint8_t value[4];
    hash_u8((uint8_t)parameters_read(parameters, index, value));
    for (uint8_t i = 0; i < sizeof value; i++)
        hash_u8(value[i]);
}

/* One setting written and read back; all of them read at the end of a run. */
void vectors_feed(void)
{
    static parameters_t parameters;
    static uint8_t left;
    const uint8_t index = (uint8_t)(draw_rarely(4) ? draw_u16() : draw_up_to(NUMBERS - 1));
    const int32_t end = ends[draw_u16() & (ENDS - 1U)] + draw_between(-1, 1);
    const int32_t value = draw_rarely(1) ? end : draw_s32();
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16),
                              (uint8_t)((uint32_t)value >> 24)};

    if (left == 0) {
        left = RUN_WRITES;
        for (uint8_t i = 0; i < NUMBERS; i++)
            hash_one(&parameters, i);
        parameters_start(&parameters, &PARAMS);
    }
    left--;
    hash_u8((uint8_t)parameters_write(&parameters, index, bytes));
    hash_u8(parameters_of_robot(index));
    hash_one(&parameters, index);
    hash_u16(parameters.config.step.speed.count_travel_um_q2);
}
