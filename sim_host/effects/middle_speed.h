/* middle_speed.h: the wheel speeds in the middle of a motor step. For drive hooks that use the back EMF. */
#ifndef BRICKPILOT_EFFECTS_MIDDLE_SPEED_H
#define BRICKPILOT_EFFECTS_MIDDLE_SPEED_H

#include "effects/vehicle.h"

/* The memory of such an effect. */
typedef struct {
    real_t speed[2]; /* rad/s at the start of the last motor step */
} before_t;

enum { MIDDLE_SPEED_MEMORY = sizeof(before_t) / sizeof(real_t) };

/* Begins a run: the effect's hook at SITE_START. */
static void middle_speed_start(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    before_t *before = (before_t *)memory;
    for (int k = 0; k < 2; k++)
        before->speed[k] = vehicle->state.wheel_speed[k];
}

/* The extrapolated speed of wheel k half a motor step ahead, in rad/s. Call it once in each step. */
IN_LANES real_t middle_speed(real_t *memory, const vehicle_t *vehicle, int k)
{
    before_t *before = (before_t *)memory;
    const real_t speed = vehicle->state.wheel_speed[k];
    const real_t middle = speed + 0.5 * (speed - before->speed[k]);
    before->speed[k] = speed;
    return middle;
}

#endif
