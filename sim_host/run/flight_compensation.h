/* flight_compensation.h: what a flight's request says of the robot, for the firmware. */
#ifndef BRICKPILOT_RUN_FLIGHT_COMPENSATION_H
#define BRICKPILOT_RUN_FLIGHT_COMPENSATION_H

#include <stdbool.h>

#include "app/loop.h"
#include "brickpilot_sim.h"

/* True where every value is within its range; also for NULL, which stands for none. */
bool flight_can_compensate(const bp_compensation *given);

/* Puts it into the firmware's constants. */
void flight_compensate(const bp_compensation *given, loop_config_t *config);

#endif
