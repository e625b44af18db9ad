#include "effects/effect.h"

#include <string.h>

/* The table, one line for each effect. Hooks run in this order.
 *
 * First come drive and motor, in the order in which a command passes them: for example, pulses are made of the whole
 * command, and a rotor in its play changes the back EMF after the drive. Then come wheels, body and floor, then masses
 * and geometry, then the sensors, in the order in which a signal passes them. */
/* clang-format off */
#define EFFECTS \
    EFFECT(start_delay) \
    EFFECT(input_delay) \
    EFFECT(speed_control) \
    EFFECT(battery_discharge) \
    EFFECT(battery_fade) \
    EFFECT(battery_sag) \
    EFFECT(pwm_quantisation) \
    EFFECT(actuator_lag) \
    EFFECT(slew_limit) \
    EFFECT(actuator_deadband) \
    EFFECT(voltage_compression) \
    EFFECT(motor_asymmetry) \
    EFFECT(direction_asymmetry) \
    EFFECT(composed_term) \
    EFFECT(supply_saturation) \
    EFFECT(pwm_coast) \
    EFFECT(zero_coast) \
    EFFECT(dead_time) \
    EFFECT(current_limit) \
    EFFECT(torque_constant_asymmetry) \
    EFFECT(motor_heating) \
    EFFECT(torque_ripple) \
    EFFECT(cogging) \
    EFFECT(gear_backlash) \
    EFFECT(coupled_inertia) \
    EFFECT(coulomb_friction) \
    EFFECT(stiction_stribeck) \
    EFFECT(load_friction) \
    EFFECT(viscous_loss) \
    EFFECT(rolling_sqrt) \
    EFFECT(constant_offset) \
    EFFECT(gravity_load) \
    EFFECT(carpet_nap) \
    EFFECT(caster_drag) \
    EFFECT(yaw_scrub) \
    EFFECT(viscous_scrub) \
    EFFECT(curve_scrub) \
    EFFECT(surge_drag) \
    EFFECT(quadratic_drag) \
    EFFECT(floor_slope) \
    EFFECT(com_forward_offset) \
    EFFECT(com_lateral_offset) \
    EFFECT(payload_mass) \
    EFFECT(wheel_radius_mismatch) \
    EFFECT(wheel_slip) \
    EFFECT(side_slip) \
    EFFECT(tyre_grip) \
    EFFECT(imu_lever_arm) \
    EFFECT(accel_misalignment) \
    EFFECT(imu_lag) \
    EFFECT(accel_bias) \
    EFFECT(gyro_scale) \
    EFFECT(gyro_asymmetry) \
    EFFECT(gyro_bias) \
    EFFECT(gyro_drift) \
    EFFECT(gyro_saturation) \
    EFFECT(encoder_scale) \
    EFFECT(speed_lag) \
    EFFECT(unsigned_sensor) \
    EFFECT(speed_delay) \
    EFFECT(gyro_delay) \
    EFFECT(sensor_delay)
/* clang-format on */

#define EFFECT(name) extern const effect_t effect_##name;
EFFECTS
#undef EFFECT

#define EFFECT(name) &effect_##name,
static const effect_t *const TABLE[] = {EFFECTS};
#undef EFFECT

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
