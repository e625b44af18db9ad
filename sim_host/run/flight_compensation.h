/* flight_compensation.h: hands the compensation of a flight's request to the firmware. */
#ifndef BRICKPILOT_RUN_FLIGHT_COMPENSATION_H
#define BRICKPILOT_RUN_FLIGHT_COMPENSATION_H

#include <stdbool.h>

#include "app/loop.h"
#include "brickpilot_sim.h"

/* Returns true where every value is within its range. NULL stands for no compensation, and is true as well. */
bool flight_can_compensate(const bp_compensation *given);

/* Writes the compensation into the firmware's configuration. */
void flight_compensate(const bp_compensation *given, loop_config_t *config);

#endif
