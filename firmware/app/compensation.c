#include "app/compensation.h"

#include "app/parameters.h"

/* Field by field: the compiler would call the library to copy a struct. */
static void apply_side(const drive_side_t *from, drive_side_t *to)
{
    to->gain_q15 = from->gain_q15;
    to->emf_mv_q15 = from->emf_mv_q15;
    to->friction_mv = from->friction_mv;
    to->offset_mv = from->offset_mv;
}

static void apply_drive(const drive_config_t *from, drive_config_t *to)
{
    apply_side(&from->left, &to->left);
    apply_side(&from->right, &to->right);
    to->deadband_mv = from->deadband_mv;
    to->half_track_m_q14 = from->half_track_m_q14;
    to->reserve_mv = from->reserve_mv;
}

void compensation_apply(const compensation_t *compensation, loop_config_t *config)
{
    speed_config_t *const speed = &config->step.speed;

    apply_drive(&compensation->drive, &config->step.mixer.drive);
    config->step.battery_sags = compensation->battery_sags;
    config->step.heading.gyro_bias_mrad_s = compensation->gyro_bias_mrad_s;
    config->step.heading.gyro_scale_q15 = compensation->gyro_scale_q15;
    speed->count_travel_um_q2 = parameters_travel_um_q2(speed->count_travel_um_q2, compensation->travel_scale_q15);
    speed->count_mismatch_q15 = compensation->count_mismatch_q15;
}
