/* mixer.h: from the two efforts to two motor voltages, and from these to the duty that this robot's motors need.
 *
 * left = surge + yaw, right = surge - yaw. Heading has priority: yaw gets what it needs of the available voltage, surge
 * gets the rest. Exactly symmetric if the drive's sides are alike and have no offset: negate yaw, and the motors change
 * places; negate both efforts and the motion, and both outputs are negated.
 * Never fails: it saturates, and reports that to the controllers.
 */
#ifndef BRICKPILOT_MIXER_MIXER_H
#define BRICKPILOT_MIXER_MIXER_H

#include "mixer/drive.h"

typedef struct {
    uint16_t battery_floor_mv;   /* a lower reading counts as this, 1000..32000 */
    int16_t max_duty_q15;        /* 1..32767 = all of the battery voltage */
    drive_config_t drive;        /* all zero: the motors are those of the model */
    uint16_t battery_nominal_mv; /* used before the first reading, 1..32000 */
    bool battery_sags;           /* the next reading corrects the voltages that the model gets */
} mixer_config_t;

/* All fields are 0 at the start. */
typedef struct {
    signals_drive_t drive; /* output of the newest step, as mixer_take_battery() has corrected it */
    uint16_t battery_mv;   /* the newest reading, or the nominal voltage: the duty is computed for it */
} mixer_state_t;

/* Takes the battery's reading, if this step has one. Where the battery sags, corrects the voltages of state->drive:
 * their duty was computed for the reading before, and the new reading is what the battery really gave. */
void mixer_take_battery(const mixer_config_t *config, mixer_state_t *state, const signals_sensors_t *sensors);

/* Sets `drive`, and keeps a copy in state->drive. state->battery_mv any; above 32000 counts as 32000. Efforts any. Reads
 * speed and yaw rate of `estimate`.
 * Voltages are within battery * max_duty minus the drive's reserve; they are what the model's motors would get. Duty is
 * drive_voltage_mv() of these divided by the battery's voltage, at most max_duty, rounded to the nearest 1/32767: the
 * full battery voltage gives 32767. Efforts of 0 give duty 0 with any drive. */
void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_estimate_t *estimate, signals_drive_t *drive);

#endif
