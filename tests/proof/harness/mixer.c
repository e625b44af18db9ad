#include "abstract.h"
#define fix_mul16_q15 open_share16_q15
#define fix_div_u32 open_div_u32
#define fix_mul_u16 open_mul_u16
#define fix_mul open_mul
#include "mixer/drive.c"
#define along along_axis
#include "mixer/mixer.c"

void mixer_safe(void)
{
    parameters_t parameters;
    const mixer_config_t *const config = &parameters.config.step.mixer;
    mixer_state_t state;
    signals_effort_t effort;
    signals_estimate_t estimate;
    signals_drive_t drive;

    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config));
    ASSUME(effort_holds(&effort));
    mixer_step(config, &state, &effort, &estimate, &drive);
    ASSERT(drive_holds(&drive));
    ASSERT(mixer_holds(&state));
    ASSERT(UP_TO(MOST_signals_effort_t_surge_mv, drive.left_mv) &&
           UP_TO(MOST_signals_effort_t_surge_mv, drive.right_mv));
    ASSERT(drive.surge_saturated >= -1 && drive.surge_saturated <= 1 && drive.yaw_saturated >= -1 &&
           drive.yaw_saturated <= 1);
    END();
}

void mixer_off(void)
{
    parameters_t parameters;
    mixer_state_t state;
    const signals_effort_t effort = {0, 0};
    signals_estimate_t estimate;
    signals_drive_t drive;

    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config));
    mixer_step(&parameters.config.step.mixer, &state, &effort, &estimate, &drive);
    ASSERT(drive.left_q15 == 0 && drive.right_q15 == 0 && drive.left_mv == 0 && drive.right_mv == 0);
    END();
}

void mixer_take_battery_safe(void)
{
    parameters_t parameters;
    mixer_state_t state;
    signals_sensors_t sensors;

    ASSUME(settings_hold(&parameters) && constants_hold(&parameters.config));
    ASSUME(mixer_holds(&state));
    mixer_take_battery(&parameters.config.step.mixer, &state, &sensors);
    ASSERT(mixer_holds(&state));
    END();
}
