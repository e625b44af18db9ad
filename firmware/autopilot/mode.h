/* mode.h: when the robot drives at all.
 *
 *   IDLE --start--> RUN --last waypoint--> ARRIVED
 *                    '----any reason-----> FAULT
 *   ARRIVED, FAULT --reset--> IDLE
 *
 * Nothing but a reset leaves FAULT. Motors are off in every mode but RUN.
 */
#ifndef BRICKPILOT_AUTOPILOT_MODE_H
#define BRICKPILOT_AUTOPILOT_MODE_H

#include "autopilot/los.h"

typedef struct {
    los_config_t los;
    uint16_t lost_ms; /* the state may be invalid for so long in RUN; the last demand is kept meanwhile */
} mode_config_t;

enum { MODE_IDLE = 0, MODE_RUN = 1, MODE_ARRIVED = 2, MODE_FAULT = 3 };
typedef uint8_t mode_name_t;

enum { MODE_NONE = 0, MODE_START = 1, MODE_ABORT = 2, MODE_RESET = 3, MODE_CUT = 4 };
typedef uint8_t mode_command_t;

enum {
    MODE_NO_FAULT = 0,
    MODE_LEG_TIMED_OUT = 1,
    MODE_LEG_OVERSHOT = 2,
    MODE_STATE_LOST = 3,
    MODE_COMMANDED = 4,
    MODE_NO_ROUTE = 5, /* started with an empty route */
    MODE_SILENT = 6    /* cut: neither a sensor nor a command was heard */
};
typedef uint8_t mode_fault_t;

/* All zero is IDLE. */
typedef struct {
    mode_name_t mode;
    mode_fault_t fault; /* why FAULT was entered; cleared by a reset */
    uint16_t lost_ms;   /* for how long the state has been invalid */
    los_state_t los;    /* of the last step in RUN; its demand is of every step */
} mode_state_t;

/* One step, of signals->sensors.period_ms, 1..255. `command` acts where the diagram has an arrow for it (abort and cut: in RUN) and
 * is ignored elsewhere. What the robot shall do and how far it is stands in state->mode, ->fault and ->los. */
void mode_step(const mode_config_t *config, const route_t *route, mode_state_t *state, const signals_state_t *signals,
               mode_command_t command);

#endif
