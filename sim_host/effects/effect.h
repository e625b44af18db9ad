/* effect.h: a named effect the nominal model lacks: a row of constants and the hooks of the sites where it acts.
 *
 * To add one: a file beside this one that defines `const effect_t effect_NAME`, a line below, a row in effects.c, and a
 * unit test. Hooks are called in the order of the table, only those that are not NULL, only of effects that are
 * switched on.
 */
#ifndef BRICKPILOT_EFFECTS_EFFECT_H
#define BRICKPILOT_EFFECTS_EFFECT_H

#include "effects/vehicle.h"

/* value: the effect's parameters, in the order of its table. memory: its own state in this run, `memory_count` doubles.
 */
typedef void effect_hook_t(const double *value, double *memory, vehicle_t *vehicle);

typedef enum {
    SITE_BUILD,  /* once, before the vehicle is put into its initial state. Changes build */
    SITE_START,  /* once, before the first step; memory is all 0 */
    SITE_TIMING, /* each motor step: when a command arrives. Changes command */
    SITE_SUPPLY, /* at the start and each body step. Changes supply */
    SITE_DRIVE,  /* each motor step: command to voltage. Changes voltage; a load on the supply changes supply too */
    SITE_MOTOR,  /* each body step. Changes motor[] */
    SITE_WHEEL,  /* each motor step, for gears too. Adds to wheel_torque and dry */
    SITE_BODY,   /* each body step. Adds to force_*, moment_yaw, drag_* */
    SITE_SENSOR, /* after each body step and before the first. Changes output */
    SITE_COUNT
} site_t;

enum { EFFECT_MEMORY = 4096 }; /* doubles of memory, all active effects of a run together */

typedef struct {
    bp_effect_info info;
    int memory_count;
    effect_hook_t *hook[SITE_COUNT];
} effect_t;

/* Row of the table, or NULL beyond the last. */
const effect_t *effect_at(int index);

/* Index of the effect of that name, or -1. */
int effect_index(const char *name);

extern const effect_t effect_accel_bias;
extern const effect_t effect_accel_misalignment;
extern const effect_t effect_actuator_deadband;
extern const effect_t effect_actuator_lag;
extern const effect_t effect_battery_discharge;
extern const effect_t effect_battery_sag;
extern const effect_t effect_carpet_nap;
extern const effect_t effect_caster_drag;
extern const effect_t effect_cogging;
extern const effect_t effect_com_forward_offset;
extern const effect_t effect_com_lateral_offset;
extern const effect_t effect_composed_term;
extern const effect_t effect_constant_offset;
extern const effect_t effect_coulomb_friction;
extern const effect_t effect_curve_scrub;
extern const effect_t effect_direction_asymmetry;
extern const effect_t effect_encoder_scale;
extern const effect_t effect_floor_slope;
extern const effect_t effect_gear_backlash;
extern const effect_t effect_gyro_bias;
extern const effect_t effect_gyro_drift;
extern const effect_t effect_gyro_saturation;
extern const effect_t effect_gyro_scale;
extern const effect_t effect_imu_lag;
extern const effect_t effect_imu_lever_arm;
extern const effect_t effect_input_delay;
extern const effect_t effect_motor_asymmetry;
extern const effect_t effect_motor_heating;
extern const effect_t effect_payload_mass;
extern const effect_t effect_pwm_coast;
extern const effect_t effect_pwm_quantisation;
extern const effect_t effect_quadratic_drag;
extern const effect_t effect_rolling_sqrt;
extern const effect_t effect_sensor_delay;
extern const effect_t effect_side_slip;
extern const effect_t effect_start_delay;
extern const effect_t effect_stiction_stribeck;
extern const effect_t effect_supply_saturation;
extern const effect_t effect_torque_constant_asymmetry;
extern const effect_t effect_torque_ripple;
extern const effect_t effect_wheel_radius_mismatch;
extern const effect_t effect_wheel_slip;
extern const effect_t effect_yaw_scrub;

#endif
