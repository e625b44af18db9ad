/* output.h: the row of outputs of a state. */
#ifndef BRICKPILOT_PLANT_OUTPUT_H
#define BRICKPILOT_PLANT_OUTPUT_H

#include "effects/vehicle.h"

/* Fills OUTPUT_COUNT values from the state, without sensor effects; NaN for what this vehicle does not have. */
void output_row(const vehicle_t *vehicle, double *out);

#endif
