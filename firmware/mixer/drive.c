#include "mixer/drive.h"

#include "core/fix.h"

int16_t drive_turning_mm_s_q4(const drive_config_t *config, int16_t yaw_rate_mrad_s)
{
    return config->half_track_m_q14 == 0 ? 0
                                         : fix_sat16(fix_share_q15(yaw_rate_mrad_s * 32L, config->half_track_m_q14));
}

/* `size_mv` in the direction of `voltage_mv`. */
static int16_t along(int32_t voltage_mv, int16_t size_mv)
{
    return size_mv == 0 ? 0 : (int16_t)fix_clamp32(voltage_mv * 16, size_mv);
}

static int16_t friction_mv(int16_t size_mv, int16_t wanted_mv, int16_t speed_mm_s_q4)
{
    if (fix_abs_u16(speed_mm_s_q4) < DRIVE_STILL_MM_S_Q4)
        return along(wanted_mv, size_mv);
    return speed_mm_s_q4 < 0 ? (int16_t)-size_mv : size_mv;
}

int16_t drive_voltage_mv(const drive_config_t *config, const drive_side_t *side, int16_t wanted_mv,
                         int16_t speed_mm_s_q4)
{
    const int32_t motor_mv = wanted_mv + fix_share_q15(speed_mm_s_q4, side->emf_mv_q15) + (int32_t)side->offset_mv +
                             friction_mv(side->friction_mv, wanted_mv, speed_mm_s_q4);
    const int32_t driven_mv = motor_mv + fix_share_q15(motor_mv, side->gain_q15);
    return fix_sat16(driven_mv + along(driven_mv, config->deadband_mv));
}
