/* plant.h: one vehicle that its caller advances, for closed loops. bp_simulate() runs a whole free run.
 *
 * There are two rates, as in fig. 3: an interval is divided evenly into body steps, and each of those into motor steps.
 * The plant uses no heap and no globals; a plant_t belongs to its caller, and the same calls give the same bytes.
 * sim_host/README.md has the equations and their accuracy.
 */
#ifndef BRICKPILOT_PLANT_PLANT_H
#define BRICKPILOT_PLANT_PLANT_H

#include "effects/effect.h"
#include "plant/model.h"
#include "plant/wheels.h"

typedef struct {
    effect_hook_t *hook;
    const double *value;
    double *memory;
} plant_hook_t;

/* Callers may read vehicle.state. Only the plant uses the other fields. */
typedef struct plant {
    vehicle_t vehicle;
    const bp_model *model; /* must outlive the plant and not change */
    double motor_step;     /* upper limits, s */
    double body_step;
    wheels_t wheels;
    plant_hook_t hook[SITE_COUNT][MODEL_EFFECTS];
    int hook_count[SITE_COUNT];
    double memory[EFFECT_MEMORY];
} plant_t;

/* Puts the vehicle into the state `initial` (NULL: at rest at the origin).
 *
 * motor_step and body_step are upper limits in s; 0 stands for those of models/rcx.toml. A coupled vehicle whose wheel
 * speeds are both 0 gets them from surge and yaw_rate. Otherwise the wheel speeds decide, unless tyres slip along the
 * track and surge or yaw_rate is not 0. Sway becomes 0, unless tyres slip sideways. BP_E_RANGE: a value is not finite,
 * a step is negative, or the motor has no inertia. */
int plant_start(plant_t *plant, const bp_model *model, const bp_state *initial, double motor_step, double body_step);

/* Puts the vehicle into another state while it runs. A field that is NaN stays, and so do the memories of the effects.
 * If the wheel speeds are NaN, a coupled vehicle gets them from surge and yaw_rate. The outputs change with the next
 * plant_advance(). BP_E_RANGE: a value is infinite. */
int plant_restart(plant_t *plant, const bp_state *state);

/* Advances the vehicle by dt seconds with the inputs held: V left and right (NaN: the motor floats). A BP_MOTOR reads
 * [0] alone. BP_E_TIME: dt is not positive and finite. BP_E_DIVERGED: the state is no longer finite. */
int plant_advance(plant_t *plant, const double input[2], double dt);

/* Counts the body steps in an interval of dt seconds, and the motor steps in each of them. BP_E_TIME: as above. */
int plant_divide(const plant_t *plant, double dt, int *body_count, int *motor_count);

/* Fills in both motors without effects. */
void plant_nominal_motors(const vehicle_t *vehicle, motor_t motor[2]);

/* Fills `out` with the OUTPUT_COUNT outputs of the present state, in the order of bp_output_name(): with the sensor
 * effects that are on, and without noise. Accelerations are means over the last plant_advance(). */
void plant_outputs(const plant_t *plant, double *out);

#endif
