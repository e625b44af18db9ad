/* plant.h: one vehicle, stepped. For closed loops; a whole open-loop run is bp_simulate().
 *
 * Multi-rate as in fig. 3: an interval is divided evenly into body steps, each of them into motor steps. No heap, no
 * globals: a plant_t is the caller's, and the same calls give the same bytes. sim_host/README.md has equations and
 * accuracy.
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

/* Read vehicle.state; the rest is the plant's own. */
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

/* Puts the vehicle into `initial` (NULL: at rest at the origin). motor_step, body_step: upper limits in s, 0 for 0.0003
 * and 0.003. A coupled vehicle with both wheel speeds 0 gets them from surge and yaw_rate; otherwise the wheel speeds
 * decide, unless tyres slip along and surge or yaw_rate is not 0; sway becomes 0, unless tyres slip across. BP_E_RANGE:
 * a value that is not finite, a negative step, or a motor without inertia. */
int plant_start(plant_t *plant, const bp_model *model, const bp_state *initial, double motor_step, double body_step);

/* Holds the inputs (left, right; V; NaN floats; a motor reads [0] alone) for dt seconds.
 * BP_E_TIME: dt not positive and finite. BP_E_DIVERGED: the state is no longer finite. */
int plant_advance(plant_t *plant, const double input[2], double dt);

/* The row of OUTPUT_COUNT values of now, in the order of bp_output_name(): without noise, with the sensor effects that
 * are on. */
void plant_outputs(const plant_t *plant, double *out);

#endif
