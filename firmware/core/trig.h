/* trig.h: sine, cosine and four-quadrant arc tangent on binary angles (65536 = one turn: overflow wraps the angle). */
#ifndef BRICKPILOT_CORE_TRIG_H
#define BRICKPILOT_CORE_TRIG_H

#include <stdint.h>

/* Q15: -32767..32767, 32767 = 1. Any angle. Error at most 2 units of Q15. sin(-a) = -sin(a) exactly. */
int16_t trig_sin_q15(uint16_t angle_bam16);
int16_t trig_cos_q15(uint16_t angle_bam16);

/* Angle of the vector (x, y) from x towards y, all four quadrants; exact on the axes and
 * diagonals; any operands. Error at most 0.02 degree. (0, 0) gives 0. atan2(-y, x) = -atan2(y, x) exactly. */
uint16_t trig_atan2_bam16(int32_t y, int32_t x);

#endif
