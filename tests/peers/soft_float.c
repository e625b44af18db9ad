/* soft_float.c: float by the routines in software that each brick's compiler or system has.
 *
 * On an AVR chip these are libgcc's and avr-libc's, with atan2f() and sqrtf(). On the RCX they are those of brickOS (libfloat.a): the
 * compiler's libgcc.a is damaged, and there is no libm, so that the root and the arc tangent are written here.
 */
#include "law.h"

num num_mul(num a, num b)
{
    return a * b;
}

num num_div(num a, num b)
{
    return a / b;
}

#ifdef __H8300__
#include "arc_tangent.h"

/* Heron's rule. Half the exponent is within 3.5 % of the root, so that two rounds reach 2e-7. */
num num_sqrt(num value)
{
    union {
        float value;
        uint32_t bits;
    } root;

    if (value <= 0)
        return 0;
    root.value = value;
    root.bits = (root.bits >> 1) + 0x1FBB4000UL;
    root.value = 0.5f * (root.value + value / root.value);
    return 0.5f * (root.value + value / root.value);
}
#else
#include <math.h>

num num_sqrt(num value)
{
    return sqrtf(value);
}

num num_atan2(num y, num x)
{
    return atan2f(y, x);
}
#endif
