/* mixer.h: the two efforts to two motor voltages, and those to duty.
 *
 * left = surge + yaw, right = surge - yaw. Heading has priority: yaw gets what voltage there is, surge what is left.
 * Exactly symmetric: negate yaw and the motors change places; negate both efforts and both outputs are negated.
 * Never fails: saturates, reports it to the controllers, and counts.
 */
#ifndef BRICKPILOT_MIXER_MIXER_H
#define BRICKPILOT_MIXER_MIXER_H

#include "core/signals.h"

typedef struct {
    uint16_t battery_floor_mv; /* a lower reading counts as this; 1000..20000 */
    int16_t max_duty_q15;      /* 1..32767 = all of the battery voltage */
} mixer_config_t;

/* All zero to begin with. Counts are of steps and stay at 65535. */
typedef struct {
    uint16_t surge_saturated_steps;
    uint16_t yaw_saturated_steps;
    uint16_t battery_low_steps; /* the reading was below the floor */
} mixer_state_t;

/* `battery_mv` any; above 20000 counts as 20000. Efforts any.
 * Voltages are within battery * max_duty; duty is voltage / battery, rounded to the nearest 1/32767: the battery's own
 * voltage gives 32767. */
void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort, uint16_t battery_mv,
                signals_drive_t *drive);

#endif
