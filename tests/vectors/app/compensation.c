#include "app/compensation.h"

#include "states.h"
#include "vectors.h"

static void hash_side(const drive_side_t *side)
{
    hash_s16(side->gain_q15);
    hash_s16(side->emf_mv_q15);
    hash_s16(side->friction_mv);
    hash_s16(side->offset_mv);
}

void vectors_feed(void)
{
    static loop_config_t config;
    static compensation_t compensation;
    const drive_config_t *const drive = &config.step.mixer.drive;

    if (draw_rarely(3))
        draw_drive_config(&compensation.drive);
    compensation.battery_sags = draw_rarely(1);
    compensation.gyro_bias_mrad_s = draw_s16();
    compensation.gyro_scale_q15 = draw_between(-32767, 32767);
    compensation.travel_scale_q15 = draw_between(-32767, 32767);
    compensation.count_mismatch_q15 = draw_between(-32767, 32767);
    config.step.speed.count_travel_um_q2 = (uint16_t)(draw_up_to(65534U) + 1U);
    compensation_apply(&compensation, &config);

    hash_side(&drive->left);
    hash_side(&drive->right);
    hash_s16(drive->deadband_mv);
    hash_s16(drive->half_track_m_q14);
    hash_s16(drive->reserve_mv);
    hash_u8(config.step.battery_sags);
    hash_s16(config.step.heading.gyro_bias_mrad_s);
    hash_s16(config.step.heading.gyro_scale_q15);
    hash_u16(config.step.speed.count_travel_um_q2);
    hash_s16(config.step.speed.count_mismatch_q15);
}
