#include "app/parameters.h"

#include "states.h"
#include "vectors.h"

enum { NUMBERS = 48, RUN_WRITES = 200, ENDS = 8 };

/* Of the settings' ranges. */
static const int32_t ends[ENDS] = {0, 20, 255, 10000, 32000, 32767, 65535L, -32000};

/* One request, taken and hashed. */
static void take(parameters_t *parameters, uint8_t number, bool writes, int32_t value, bool running)
{
    static uint8_t data[6];

    data[1] = (uint8_t)(number | (writes ? 0x40 : 0));
    for (uint8_t i = 2; i < sizeof data; i++) {
        data[i] = (uint8_t)value;
        value >>= 8;
    }
    hash_u8((uint8_t)parameters_take(parameters, running, data));
    for (uint8_t i = 0; i < sizeof data; i++)
        hash_u8(data[i]);
}

/* One setting written and read back; all of them read at the end of a run. */
void vectors_feed(void)
{
    static parameters_t parameters;
    static uint8_t left;
    const uint8_t index = (uint8_t)(draw_rarely(4) ? draw_u16() & 63U : draw_up_to(NUMBERS - 1));
    const int32_t end = ends[draw_u16() & (ENDS - 1U)] + draw_between(-1, 1);
    const int32_t value = draw_rarely(1) ? end : draw_s32();
    const bool running = draw_rarely(2);

    if (left == 0) {
        left = RUN_WRITES;
        for (uint8_t i = 0; i < NUMBERS; i++)
            take(&parameters, i, false, 0, true);
        parameters_start(&parameters, &PARAMS);
    }
    left--;
    take(&parameters, index, true, value, running);
    take(&parameters, index, false, 0, false);
    hash_u16(parameters.config.step.speed.count_travel_um_q2);
}
