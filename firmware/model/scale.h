/* scale.h: multiplication by a real number below 1, stored as a 15-bit mantissa and a shift.
 *
 * The model's coefficients span six decades. Each coefficient has a mantissa of 16384..32767, so that its relative
 * error is at most 2^-15 = 3.1e-5, whatever its size. Products are rounded to the nearest, halves away from zero:
 * negating the value negates the result.
 */
#ifndef BRICKPILOT_MODEL_SCALE_H
#define BRICKPILOT_MODEL_SCALE_H

#include <stdint.h>

typedef struct {
    int16_t mantissa; /* 16384..32767, or the negative of that, or 0 */
    uint8_t shift;    /* 0..31 */
} scale_t;

/* value * mantissa / 2^(15 + shift). Any value; error at most 3/4 of a unit. The result is not larger than the value.
 */
int32_t scale_apply(const scale_t *scale, int32_t value);

/* value * mantissa / 2^shift. Any value; error at most 3/4 of a unit. */
int32_t scale_apply16(const scale_t *scale, int16_t value);

#endif
