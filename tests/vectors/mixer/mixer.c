#include "mixer/mixer.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

void vectors_feed(void)
{
    static mixer_config_t config = {.battery_floor_mv = 5000, .max_duty_q15 = 32767};
    static mixer_state_t state;
    static signals_estimate_t estimate;
    static signals_sensors_t sensors;
    signals_effort_t effort;
    signals_drive_t drive;

    if (draw_rarely(5)) {
        config.battery_floor_mv = (uint16_t)draw_between(1000, 32000);
        config.max_duty_q15 = draw_between(1, 32767);
        draw_drive_config(&config.drive);
        if (draw_rarely(1))
            bytes_clear(&config.drive, sizeof config.drive);
    }
    effort.surge_mv = draw_s16();
    effort.yaw_mv = draw_s16();
    estimate.speed_mm_s_q4 = draw_s16();
    estimate.yaw_rate_mrad_s = draw_s16();
    config.battery_sags = draw_rarely(3);
    sensors.have = config.battery_sags ? SENSOR_BATTERY : 0;
    if (config.battery_sags)
        sensors.battery_mv = draw_up_to(32000);
    mixer_take_battery(&config, &state, &sensors);
    hash_drive(&state.drive);
    state.battery_mv = draw_up_to(draw_rarely(3) ? 65535U : 12000);
    mixer_step(&config, &state, &effort, &estimate, &drive);
    hash_drive(&drive);
}
