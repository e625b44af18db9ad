#include "effects/effect.h"

#include <string.h>

static const effect_t *const TABLE[] = {
    /* Input and motor, in the order in which a command passes them: pulses are made of the whole, and the back EMF of
     * a rotor in its play comes after all that the drive does. */
    &effect_start_delay,
    &effect_input_delay,
    &effect_battery_discharge,
    &effect_battery_sag,
    &effect_pwm_quantisation,
    &effect_actuator_lag,
    &effect_actuator_deadband,
    &effect_motor_asymmetry,
    &effect_direction_asymmetry,
    &effect_composed_term,
    &effect_supply_saturation,
    &effect_pwm_coast,
    &effect_torque_constant_asymmetry,
    &effect_motor_heating,
    &effect_torque_ripple,
    &effect_cogging,
    &effect_gear_backlash,
    &effect_coulomb_friction,
    &effect_stiction_stribeck,
    &effect_rolling_sqrt,
    &effect_constant_offset,
    &effect_carpet_nap,
    &effect_caster_drag,
    &effect_yaw_scrub,
    &effect_curve_scrub,
    &effect_quadratic_drag,
    &effect_floor_slope,
    /* What the vehicle is made of. */
    &effect_com_forward_offset,
    &effect_com_lateral_offset,
    &effect_payload_mass,
    &effect_wheel_radius_mismatch,
    &effect_wheel_slip,
    &effect_side_slip,
    /* Sensors, in the order in which a signal passes them. */
    &effect_imu_lever_arm,
    &effect_accel_misalignment,
    &effect_imu_lag,
    &effect_accel_bias,
    &effect_gyro_scale,
    &effect_gyro_bias,
    &effect_gyro_drift,
    &effect_gyro_saturation,
    &effect_encoder_scale,
    &effect_sensor_delay,
};

enum { TABLE_COUNT = sizeof TABLE / sizeof TABLE[0] };

const effect_t *effect_at(int index)
{
    return index < 0 || index >= TABLE_COUNT ? NULL : TABLE[index];
}

int effect_index(const char *name)
{
    for (int i = 0; i < TABLE_COUNT; i++)
        if (strcmp(TABLE[i]->info.name, name) == 0)
            return i;
    return -1;
}

const bp_effect_info *bp_effect(int index)
{
    const effect_t *effect = effect_at(index);
    return effect == NULL ? NULL : &effect->info;
}
