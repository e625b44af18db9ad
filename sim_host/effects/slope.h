/* slope.h: how gravity acts on a vehicle on a floor that is not level. */
#ifndef BRICKPILOT_EFFECTS_SLOPE_H
#define BRICKPILOT_EFFECTS_SLOPE_H

#include "effects/vehicle.h"

/* Gravity's pull along the body's axes, per mass, m/s^2. */
typedef struct {
    real_t surge, sway;
} pull_t;

/* The pull at `heading`. slope_x, slope_y: sine of the floor's downward slope along the room's axes x and y. */
static inline pull_t slope_pull(const vehicle_t *vehicle, real_t slope_x, real_t slope_y, real_t heading)
{
    const real_t gravity = vehicle->parameter[PARAMETER_GRAVITY];
    real_t cosine, sine;
    real_turn(heading, &cosine, &sine);
    return (pull_t){gravity * (slope_x * cosine + slope_y * sine), gravity * (slope_y * cosine - slope_x * sine)};
}

/* Applies the pull to the vehicle's centre of mass. For body hooks. */
static inline void slope_push(vehicle_t *vehicle, pull_t pull)
{
    const build_t *build = &vehicle->build;
    vehicle->force_surge += build->mass * pull.surge;
    vehicle->force_sway += build->mass * pull.sway;
    vehicle->moment_yaw += build->mass * (build->com_forward * pull.sway - build->com_right * pull.surge);
}

/* Accelerometers show specific force, which does not include gravity. For sensor hooks. */
static inline void slope_show(vehicle_t *vehicle, pull_t pull)
{
    vehicle->output[OUTPUT_ACCEL_SURGE] -= pull.surge;
    vehicle->output[OUTPUT_ACCEL_SWAY] -= pull.sway;
}

/* Heading in the middle of the last body step: accelerations are means over this step. For sensor hooks. */
static inline real_t slope_heading(const vehicle_t *vehicle)
{
    return vehicle->state.heading - 0.5 * vehicle->step * vehicle->state.yaw_rate;
}

/* The position x in m in the middle of the last body step. */
static inline real_t slope_position(const vehicle_t *vehicle)
{
    const state_t *state = &vehicle->state;
    const real_t heading = slope_heading(vehicle);
    real_t cosine, sine;
    real_turn(heading, &cosine, &sine);
    return state->x - 0.5 * vehicle->step * (state->surge * cosine - state->sway * sine);
}

#endif
