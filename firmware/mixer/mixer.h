/* mixer.h: the two efforts to two motor voltages, those to what this robot's motors need for them, and that to duty.
 *
 * left = surge + yaw, right = surge - yaw. Heading has priority: yaw gets what voltage there is, surge what is left.
 * Exactly symmetric with a drive whose sides are alike and have no offset: negate yaw and the motors change places;
 * negate both efforts and both outputs are negated (and the motion with them).
 * Never fails: saturates, reports it to the controllers, and counts.
 */
#ifndef BRICKPILOT_MIXER_MIXER_H
#define BRICKPILOT_MIXER_MIXER_H

#include "mixer/drive.h"

typedef struct {
    uint16_t battery_floor_mv; /* a lower reading counts as this; 1000..20000 */
    int16_t max_duty_q15;      /* 1..32767 = all of the battery voltage */
    drive_config_t drive;      /* all zero: the motors are the model's */
} mixer_config_t;

/* All zero to begin with. Counts are of steps and stay at 65535. */
typedef struct {
    signals_drive_t drive; /* what the motors get from the newest step on */
    uint16_t battery_mv;   /* the newest reading: what the duty is made for */
    uint16_t surge_saturated_steps;
    uint16_t yaw_saturated_steps;
    uint16_t battery_low_steps; /* the reading was below the floor */
} mixer_state_t;

/* The duty was made for state->battery_mv; the next reading says what the motors had: the voltages told become those. */
void mixer_correct(const mixer_config_t *config, mixer_state_t *state, uint16_t battery_mv);

/* Sets state->drive. state->battery_mv any; above 20000 counts as 20000. Efforts any.
 * Voltages are within battery * max_duty less the drive's reserve, and are those that the model's motors would get;
 * duty is what drive_voltage_mv() makes of them, at most max_duty, over battery, rounded to the nearest 1/32767: the
 * battery's own voltage gives 32767. No effort gives duty 0, whatever the drive. `motion`: speed and yaw rate count. */
void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_state_t *motion);

#endif
