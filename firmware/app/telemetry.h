/* telemetry.h: what the pipeline thinks, as bytes: little-endian, the same on every target. */
#ifndef BRICKPILOT_APP_TELEMETRY_H
#define BRICKPILOT_APP_TELEMETRY_H

#include "app/step.h"

/* Offset: content.
 *   0 tick, uint32              4 mode, uint8              5 fault, uint8
 *   6 guidance phase, uint8     7 waypoint, uint8          8 x um, int32
 *  12 y um, int32              16 heading bam16, uint16   18 speed mm/s q4, int16
 *  20 yaw rate mrad/s, int16   22 demand speed q4, int16  24 demand heading bam16, uint16
 *  26 cross-track mm, int16    28 surge effort mV, int16  30 yaw effort mV, int16
 *  32 left duty q15, int16     34 right duty q15, int16   36 battery mV, uint16
 *  38 flags, uint8: 1 at rest, 2 state valid, 4 surge saturated, 8 yaw saturated
 *  39 0x00 */
enum { TELEMETRY_SIZE = 40 };

void telemetry_pack(uint32_t tick, const step_state_t *state, const step_output_t *output,
                    uint8_t record[TELEMETRY_SIZE]);

#endif
