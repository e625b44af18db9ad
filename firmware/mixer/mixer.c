#include "mixer/mixer.h"

#include "core/bytes.h"
#include "core/fix.h"

enum { VOLTAGE_MAX_MV = 32000 };

/* The battery's voltage, and the largest voltage that a motor may get. */
typedef struct {
    uint16_t battery_mv;
    int16_t most_mv;
} supply_t;

static supply_t take_supply(const mixer_config_t *config, const mixer_state_t *state)
{
    supply_t supply = {.battery_mv = state->battery_mv};

    if (supply.battery_mv < config->battery_floor_mv)
        supply.battery_mv = config->battery_floor_mv;
    if (supply.battery_mv > VOLTAGE_MAX_MV)
        supply.battery_mv = VOLTAGE_MAX_MV;
    supply.most_mv = (int16_t)supply.battery_mv;
    if (config->max_duty_q15 != FIX_INT16_MAX)
        supply.most_mv =
            (int16_t)fix_div_u32(fix_mul_u16(supply.battery_mv, (uint16_t)config->max_duty_q15), FIX_INT16_MAX);
    return supply;
}

static int16_t duty_q15(const supply_t *supply, int16_t needed_mv)
{
    const int16_t motor_mv = fix_clamp16(needed_mv, supply->most_mv);
    const uint32_t scaled = fix_mul_u16(fix_abs_u16(motor_mv), FIX_INT16_MAX) + (supply->battery_mv >> 1);
    const int16_t magnitude = (int16_t)fix_div_u32(scaled, supply->battery_mv);
    return motor_mv < 0 ? (int16_t)-magnitude : magnitude;
}

static void drive_motors(const drive_config_t *config, const supply_t *supply, const signals_estimate_t *estimate,
                         signals_drive_t *drive)
{
    const int16_t turning = drive_turning_mm_s_q4(config, estimate->yaw_rate_mrad_s);
    const int16_t left_mm_s_q4 = fix_add16(estimate->speed_mm_s_q4, turning);
    const int16_t right_mm_s_q4 = fix_sub16(estimate->speed_mm_s_q4, turning);

    drive->left_q15 = duty_q15(supply, drive_voltage_mv(config, &config->left, drive->left_mv, left_mm_s_q4));
    drive->right_q15 = duty_q15(supply, drive_voltage_mv(config, &config->right, drive->right_mv, right_mm_s_q4));
}

/* Corrects the model's voltages: their duty was for the previous reading, but the battery gave `battery_mv`. */
static void correct(const mixer_config_t *config, mixer_state_t *state, uint16_t battery_mv)
{
    const uint16_t floor_mv = config->battery_floor_mv;
    const uint16_t believed_mv = state->battery_mv < floor_mv ? floor_mv : state->battery_mv;
    const int16_t change_mv = (int16_t)(battery_mv - believed_mv);
    signals_drive_t *const drive = &state->drive;

    drive->left_mv = fix_add16(drive->left_mv, fix_mul16_q15(change_mv, drive->left_q15));
    drive->right_mv = fix_add16(drive->right_mv, fix_mul16_q15(change_mv, drive->right_q15));
}

void mixer_take_battery(const mixer_config_t *config, mixer_state_t *state, const signals_sensors_t *sensors)
{
    if (SIGNALS_HAVE(sensors, SENSOR_BATTERY)) {
        if (config->battery_sags)
            correct(config, state, sensors->battery_mv);
        state->battery_mv = sensors->battery_mv;
    } else if (state->battery_mv == 0) {
        state->battery_mv = config->battery_nominal_mv;
    }
}

void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_estimate_t *estimate, signals_drive_t *drive)
{
    const supply_t supply = take_supply(config, state);
    const int16_t unreserved_mv = (int16_t)(supply.most_mv - config->drive.reserve_mv);
    const int16_t available_mv = unreserved_mv < 0 ? 0 : unreserved_mv;
    const int16_t yaw_mv = fix_clamp16(effort->yaw_mv, available_mv);
    const int16_t surge_mv = fix_clamp16(effort->surge_mv, (int16_t)(available_mv - (int16_t)fix_abs_u16(yaw_mv)));

    state->drive.left_mv = (int16_t)(surge_mv + yaw_mv);
    state->drive.right_mv = (int16_t)(surge_mv - yaw_mv);
    state->drive.left_q15 = 0;
    state->drive.right_q15 = 0;
    state->drive.surge_saturated = fix_compare16(effort->surge_mv, surge_mv);
    state->drive.yaw_saturated = fix_compare16(effort->yaw_mv, yaw_mv);
    if (surge_mv != 0 || yaw_mv != 0)
        drive_motors(&config->drive, &supply, estimate, &state->drive);
    bytes_copy(drive, &state->drive, sizeof *drive);
}
