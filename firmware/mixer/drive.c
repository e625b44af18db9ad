#include "mixer/drive.h"

#include "core/fix.h"

enum { FULL_FROM_MV = 2047 }; /* 16 times this voltage is above any size_mv */

int16_t drive_turning_mm_s_q4(const drive_config_t *config, int16_t yaw_rate_mrad_s)
{
    return fix_sat16(fix_trunc_shift(fix_mul(yaw_rate_mrad_s, config->half_track_m_q14), 10));
}

/* `size_mv` in the direction of `voltage_mv`. */
static int16_t along(int16_t voltage_mv, int16_t size_mv)
{
    return size_mv == 0 ? 0 : fix_clamp16((int16_t)(fix_clamp16(voltage_mv, FULL_FROM_MV) * 16), size_mv);
}

int16_t drive_voltage_mv(const drive_config_t *config, const drive_side_t *side, int16_t wanted_mv,
                         int16_t speed_mm_s_q4)
{
    int16_t mv = fix_add16(fix_add16(wanted_mv, fix_mul16_q15(speed_mm_s_q4, side->emf_mv_q15)), side->offset_mv);

    if (fix_abs_u16(speed_mm_s_q4) >= DRIVE_STILL_MM_S_Q4)
        wanted_mv = speed_mm_s_q4 < 0 ? -FULL_FROM_MV : FULL_FROM_MV;
    mv = fix_add16(mv, along(wanted_mv, side->friction_mv));
    mv = fix_add16(mv, fix_mul16_q15(mv, side->gain_q15));
    return fix_add16(mv, along(mv, config->deadband_mv));
}
