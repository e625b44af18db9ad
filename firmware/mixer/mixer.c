#include "mixer/mixer.h"

#include "core/fix.h"

enum { VOLTAGE_MAX_MV = 20000 };

static void take_supply(const mixer_config_t *config, mixer_state_t *state, uint16_t battery_mv)
{
    if (battery_mv < config->battery_floor_mv) {
        state->battery_low_steps = fix_count_u16(state->battery_low_steps);
        battery_mv = config->battery_floor_mv;
    } else if (battery_mv > VOLTAGE_MAX_MV) {
        battery_mv = VOLTAGE_MAX_MV;
    }
    state->battery_mv = battery_mv;
    if (config->max_duty_q15 != FIX_INT16_MAX)
        battery_mv = (uint16_t)fix_div_u32(fix_mul_u16(battery_mv, (uint16_t)config->max_duty_q15), FIX_INT16_MAX);
    state->most_mv = (int16_t)battery_mv;
}

static int16_t duty_q15(const mixer_state_t *state, int16_t needed_mv)
{
    const int16_t motor_mv = fix_clamp16(needed_mv, state->most_mv);
    const uint16_t battery_mv = state->battery_mv;
    const uint32_t scaled = fix_mul_u16(fix_abs_u16(motor_mv), FIX_INT16_MAX) + (battery_mv >> 1);
    const int16_t magnitude = (int16_t)fix_div_u32(scaled, battery_mv);
    return motor_mv < 0 ? (int16_t)-magnitude : magnitude;
}

static void drive_motors(const drive_config_t *config, const mixer_state_t *state, const signals_state_t *motion,
                         signals_drive_t *drive)
{
    const int16_t turning = drive_turning_mm_s_q4(config, motion->yaw_rate_mrad_s);
    const int16_t left_mm_s_q4 = fix_add16(motion->speed_mm_s_q4, turning);
    const int16_t right_mm_s_q4 = fix_sub16(motion->speed_mm_s_q4, turning);

    drive->left_q15 = duty_q15(state, drive_voltage_mv(config, &config->left, drive->left_mv, left_mm_s_q4));
    drive->right_q15 = duty_q15(state, drive_voltage_mv(config, &config->right, drive->right_mv, right_mm_s_q4));
}

void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_state_t *motion, uint16_t battery_mv, signals_drive_t *drive)
{
    int16_t available_mv, yaw_mv, surge_mv;

    take_supply(config, state, battery_mv);
    available_mv = (int16_t)(state->most_mv - config->drive.reserve_mv);
    if (available_mv < 0)
        available_mv = 0;
    yaw_mv = fix_clamp16(effort->yaw_mv, available_mv);
    surge_mv = fix_clamp16(effort->surge_mv, (int16_t)(available_mv - (int16_t)fix_abs_u16(yaw_mv)));

    drive->left_mv = (int16_t)(surge_mv + yaw_mv);
    drive->right_mv = (int16_t)(surge_mv - yaw_mv);
    drive->left_q15 = 0;
    drive->right_q15 = 0;
    drive->surge_saturated = fix_excess(effort->surge_mv, surge_mv, &state->surge_saturated_steps);
    drive->yaw_saturated = fix_excess(effort->yaw_mv, yaw_mv, &state->yaw_saturated_steps);
    if (surge_mv != 0 || yaw_mv != 0)
        drive_motors(&config->drive, state, motion, drive);
}
