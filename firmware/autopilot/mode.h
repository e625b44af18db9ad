/* mode.h: decides when the robot drives.
 *
 *   IDLE --start--> RUN --last waypoint--> ARRIVED
 *                    '----any reason-----> FAULT
 *   ARRIVED, FAULT --reset--> IDLE
 *
 * Only a reset leaves FAULT. Motors are off in every mode but RUN. If the gyro's bias is not learnt yet, a run begins
 * with a rest of up to 255 steps, in LOS_BEGIN and with motors off. If the bias is not learnt after this rest, the
 * robot drives without it, and signals_estimate_t.bias_unknown says so.
 */
#ifndef BRICKPILOT_AUTOPILOT_MODE_H
#define BRICKPILOT_AUTOPILOT_MODE_H

#include "autopilot/los.h"

typedef struct {
    los_config_t los;
    uint16_t lost_ms; /* longest time in RUN with an invalid estimate; during it the last demand is kept */
} mode_config_t;

enum { MODE_IDLE = 0, MODE_RUN = 1, MODE_ARRIVED = 2, MODE_FAULT = 3 };
typedef uint8_t mode_name_t;

enum {
    MODE_NO_FAULT = 0,
    MODE_LEG_TIMED_OUT = 1,
    MODE_LEG_OVERSHOT = 2,
    MODE_STATE_LOST = 3,
    MODE_COMMANDED = 4,
    MODE_NO_ROUTE = 5, /* started with an empty route */
    MODE_SILENT = 6,   /* cut: no sensor reading and no message came for too long */
    MODE_LATE = 7      /* cut: a tick came later than the watchdog allows */
};
typedef uint8_t mode_fault_t;

/* The control loop itself gives the last two commands. Each causes the fault of the same number. */
enum {
    MODE_NONE = 0,
    MODE_START = 1,
    MODE_ABORT = 2,
    MODE_RESET = 3,
    MODE_CUT_SILENT = MODE_SILENT,
    MODE_CUT_LATE = MODE_LATE
};
typedef uint8_t mode_command_t;

/* With all fields 0 the mode is IDLE. */
typedef struct {
    signals_demand_t demand; /* demand of the newest step */
    mode_name_t mode;
    mode_fault_t fault;   /* why FAULT was entered; cleared by a reset */
    uint16_t lost_ms;     /* how long the estimate has been invalid */
    uint8_t waited_steps; /* steps that this run has waited at rest for the gyro's bias */
    los_state_t los;      /* guidance of the newest step in RUN */
} mode_state_t;

/* One step of estimate->period_ms. `command` acts where the diagram has an arrow for it (abort and cut: in RUN); elsewhere it is
 * ignored. Sets `demand`: motors off, or speed and heading. */
void mode_step(const mode_config_t *config, const route_t *route, mode_state_t *state,
               const signals_estimate_t *estimate, mode_command_t command, signals_demand_t *demand);

#endif
