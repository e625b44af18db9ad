#include "mixer/mixer.h"

#include "core/fix.h"

enum { VOLTAGE_MAX_MV = 20000 };

/* What the motors are driven with in this step. */
typedef struct {
    uint16_t battery_mv;
    int16_t most_mv;
} supply_t;

static void supply_from(const mixer_config_t *config, mixer_state_t *state, uint16_t battery_mv, supply_t *supply)
{
    if (battery_mv < config->battery_floor_mv) {
        state->battery_low_steps = fix_count_u16(state->battery_low_steps);
        battery_mv = config->battery_floor_mv;
    } else if (battery_mv > VOLTAGE_MAX_MV) {
        battery_mv = VOLTAGE_MAX_MV;
    }
    supply->battery_mv = battery_mv;
    if (config->max_duty_q15 != FIX_INT16_MAX)
        battery_mv = (uint16_t)fix_div_u32(fix_mul_u16(battery_mv, (uint16_t)config->max_duty_q15), FIX_INT16_MAX);
    supply->most_mv = (int16_t)battery_mv;
}

/* 1 where more was asked than given, -1 where less, 0 where given in full; counts. */
static int8_t saturation(int16_t asked_mv, int16_t given_mv, uint16_t *steps)
{
    if (asked_mv == given_mv)
        return 0;
    *steps = fix_count_u16(*steps);
    return asked_mv > given_mv ? 1 : -1;
}

static int16_t duty_q15(const supply_t *supply, int16_t needed_mv)
{
    const int16_t motor_mv = fix_clamp16(needed_mv, supply->most_mv);
    const uint16_t battery_mv = supply->battery_mv;
    const uint32_t scaled = fix_mul_u16(fix_abs_u16(motor_mv), FIX_INT16_MAX) + (battery_mv >> 1);
    const int16_t magnitude = (int16_t)fix_div_u32(scaled, battery_mv);
    return motor_mv < 0 ? (int16_t)-magnitude : magnitude;
}

static void drive_motors(const drive_config_t *config, const signals_state_t *motion, const supply_t *supply,
                         signals_drive_t *drive)
{
    const int16_t turning = drive_turning_mm_s_q4(config, motion->yaw_rate_mrad_s);
    const int16_t left_mm_s_q4 = fix_add16(motion->speed_mm_s_q4, turning);
    const int16_t right_mm_s_q4 = fix_sub16(motion->speed_mm_s_q4, turning);

    drive->left_q15 = duty_q15(supply, drive_voltage_mv(config, &config->left, drive->left_mv, left_mm_s_q4));
    drive->right_q15 = duty_q15(supply, drive_voltage_mv(config, &config->right, drive->right_mv, right_mm_s_q4));
}

void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_state_t *motion, uint16_t battery_mv, signals_drive_t *drive)
{
    supply_t supply;
    int16_t available_mv, yaw_mv, surge_mv;

    supply_from(config, state, battery_mv, &supply);
    available_mv = (int16_t)(supply.most_mv - config->drive.reserve_mv);
    if (available_mv < 0)
        available_mv = 0;
    yaw_mv = fix_clamp16(effort->yaw_mv, available_mv);
    surge_mv = fix_clamp16(effort->surge_mv, (int16_t)(available_mv - (int16_t)fix_abs_u16(yaw_mv)));

    drive->left_mv = (int16_t)(surge_mv + yaw_mv);
    drive->right_mv = (int16_t)(surge_mv - yaw_mv);
    drive->surge_saturated = saturation(effort->surge_mv, surge_mv, &state->surge_saturated_steps);
    drive->yaw_saturated = saturation(effort->yaw_mv, yaw_mv, &state->yaw_saturated_steps);
    drive->left_q15 = 0;
    drive->right_q15 = 0;
    if (surge_mv != 0 || yaw_mv != 0)
        drive_motors(&config->drive, motion, &supply, drive);
}
