#include "mixer/mixer.h"

#include "core/fix.h"

enum { VOLTAGE_MAX_MV = 20000 };

static uint16_t usable_battery_mv(const mixer_config_t *config, mixer_state_t *state, uint16_t battery_mv)
{
    if (battery_mv < config->battery_floor_mv) {
        state->battery_low_steps = fix_count_u16(state->battery_low_steps);
        return config->battery_floor_mv;
    }
    return battery_mv > VOLTAGE_MAX_MV ? VOLTAGE_MAX_MV : battery_mv;
}

/* 1 where more was asked than given, -1 where less, 0 where given in full; counts. */
static int8_t saturation(int16_t asked_mv, int16_t given_mv, uint16_t *steps)
{
    if (asked_mv == given_mv)
        return 0;
    *steps = fix_count_u16(*steps);
    return asked_mv > given_mv ? 1 : -1;
}

static int16_t duty_q15(int16_t needed_mv, int16_t most_mv, uint16_t battery_mv)
{
    const int16_t motor_mv = fix_clamp16(needed_mv, most_mv);
    const int16_t half_mv = (int16_t)(battery_mv >> 1);
    const int32_t scaled = fix_mul(motor_mv, FIX_INT16_MAX) + (motor_mv < 0 ? -half_mv : half_mv);
    return (int16_t)fix_div(scaled, battery_mv);
}

static void drive_motors(const drive_config_t *config, const signals_state_t *motion, uint16_t battery_mv,
                         int16_t most_mv, signals_drive_t *drive)
{
    const int16_t turning = drive_turning_mm_s_q4(config, motion->yaw_rate_mrad_s);
    const int16_t left_mm_s_q4 = fix_add16(motion->speed_mm_s_q4, turning);
    const int16_t right_mm_s_q4 = fix_sub16(motion->speed_mm_s_q4, turning);
    const int16_t left_mv = drive_voltage_mv(config, &config->left, drive->left_mv, left_mm_s_q4);
    const int16_t right_mv = drive_voltage_mv(config, &config->right, drive->right_mv, right_mm_s_q4);

    drive->left_q15 = duty_q15(left_mv, most_mv, battery_mv);
    drive->right_q15 = duty_q15(right_mv, most_mv, battery_mv);
}

static int16_t most_voltage_mv(const mixer_config_t *config, uint16_t battery_mv)
{
    if (config->max_duty_q15 == FIX_INT16_MAX)
        return (int16_t)battery_mv;
    return (int16_t)fix_div_u32(fix_mul_u16(battery_mv, (uint16_t)config->max_duty_q15), FIX_INT16_MAX);
}

void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_state_t *motion, uint16_t battery_mv, signals_drive_t *drive)
{
    const uint16_t battery = usable_battery_mv(config, state, battery_mv);
    const int16_t most_mv = most_voltage_mv(config, battery);
    const int16_t available_mv = most_mv > config->drive.reserve_mv ? (int16_t)(most_mv - config->drive.reserve_mv) : 0;
    const int16_t yaw_mv = fix_clamp16(effort->yaw_mv, available_mv);
    const int16_t left_over_mv = (int16_t)(available_mv - (int16_t)fix_abs_u16(yaw_mv));
    const int16_t surge_mv = fix_clamp16(effort->surge_mv, left_over_mv);

    drive->left_mv = (int16_t)(surge_mv + yaw_mv);
    drive->right_mv = (int16_t)(surge_mv - yaw_mv);
    drive->left_q15 = 0;
    drive->right_q15 = 0;
    if (surge_mv != 0 || yaw_mv != 0)
        drive_motors(&config->drive, motion, battery, most_mv, drive);
    drive->surge_saturated = saturation(effort->surge_mv, surge_mv, &state->surge_saturated_steps);
    drive->yaw_saturated = saturation(effort->yaw_mv, yaw_mv, &state->yaw_saturated_steps);
}
