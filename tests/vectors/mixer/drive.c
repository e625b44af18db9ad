#include "mixer/drive.h"

#include "states.h"
#include "vectors.h"

void vectors_feed(void)
{
    static drive_config_t config;
    int16_t wanted_mv, speed_mm_s_q4;

    if (draw_rarely(3))
        draw_drive_config(&config);
    hash_s16(drive_turning_mm_s_q4(&config, draw_s16()));
    wanted_mv = draw_s16();
    speed_mm_s_q4 = draw_s16();
    hash_s16(drive_voltage_mv(&config, &config.left, wanted_mv, speed_mm_s_q4));
}
