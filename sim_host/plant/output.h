/* output.h: the outputs that follow from a state. */
#ifndef BRICKPILOT_PLANT_OUTPUT_H
#define BRICKPILOT_PLANT_OUTPUT_H

#include "effects/vehicle.h"

/* Fills OUTPUT_COUNT values from the state, without sensor effects. Outputs that this vehicle does not have are NaN. */
void output_row(const vehicle_t *vehicle, double *out);

#endif
