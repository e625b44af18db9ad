/* telemetry.h: the state of the loop and its pipeline as messages of hal/wire/brickpilot.dbc. */
#ifndef BRICKPILOT_APP_TELEMETRY_H
#define BRICKPILOT_APP_TELEMETRY_H

#include "app/loop.h"
#include "wire/message.h"

/* The parts of the telemetry, in the order of their ids. */
enum {
    TELEMETRY_X = 0,
    TELEMETRY_Y = 1,
    TELEMETRY_TRACK = 2,
    TELEMETRY_DEMAND = 3,
    TELEMETRY_SPEED = 4,
    TELEMETRY_HEADING = 5,
    TELEMETRY_EFFORT = 6,
    TELEMETRY_PARTS = 7
};
typedef uint8_t telemetry_part_t;

/* Makes `message` the given part of the telemetry of the newest tick. */
void telemetry_part(telemetry_part_t part, const loop_state_t *state, message_t *message);

#ifndef MONITOR_OFF
/* Makes `message` the MONITOR_ message of a channel of the monitor, 0..MONITOR_CHANNELS - 1. */
void telemetry_monitor(uint8_t channel, const loop_state_t *state, message_t *message);
#endif

/* Makes `message` the HEARTBEAT of the newest tick. */
void telemetry_heartbeat(const loop_state_t *state, message_t *message);

#endif
