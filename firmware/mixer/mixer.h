/* mixer.h: converts the two efforts into two motor voltages, and these into the duty that this robot's motors need.
 *
 * left = surge + yaw, right = surge - yaw. Heading has priority: yaw gets what it needs of the available voltage, surge
 * gets the rest. Exactly symmetric if both sides of the drive are alike and have no offset: negate yaw, and left and
 * right are exchanged; negate both efforts and the motion, and both outputs are negated.
 * Never fails: it saturates, and reports that to the controllers.
 */
#ifndef BRICKPILOT_MIXER_MIXER_H
#define BRICKPILOT_MIXER_MIXER_H

#include "mixer/drive.h"

typedef struct {
    uint16_t battery_floor_mv;   /* a lower reading counts as this voltage, 1000..32000 */
    int16_t max_duty_q15;        /* largest duty, 1..32767; 32767 = all of the battery voltage */
    drive_config_t drive;        /* all zero: the motors are those of the model */
    uint16_t battery_nominal_mv; /* used before the first reading, 1..32000 */
    bool battery_sags;           /* true: each new reading corrects the voltages that the model gets */
} mixer_config_t;

/* All fields are 0 at the start. */
typedef struct {
    signals_drive_t drive; /* output of the newest step, as mixer_take_battery() has corrected it */
    uint16_t battery_mv;   /* the newest reading, or the nominal voltage: the duty is computed for it */
} mixer_state_t;

/* Takes the battery's reading, if this step has one. If battery_sags, corrects the voltages of state->drive: their duty
 * was computed for the previous reading, and the new reading is what the battery really gave. */
void mixer_take_battery(const mixer_config_t *config, mixer_state_t *state, const signals_sensors_t *sensors);

/* Sets `drive`, and keeps a copy in state->drive. Any efforts and any state->battery_mv are allowed; above 32000 it
 * counts as 32000. Reads speed and yaw rate of `estimate`. The voltages are those for the model's motors, within
 * battery * max_duty minus the drive's reserve. The duty is their drive_voltage_mv() divided by the battery's voltage,
 * at most max_duty, rounded to the nearest 1/32767: the full battery voltage gives 32767. Efforts of 0 give duty 0
 * with any drive. */
void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort,
                const signals_estimate_t *estimate, signals_drive_t *drive);

#endif
