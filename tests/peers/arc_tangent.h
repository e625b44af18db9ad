/* arc_tangent.h: four-quadrant arc tangent by num_mul() and num_div(). The polynomial is Hastings's, Approximations for Digital Computers,
 * 1955, sheet 9: within 8.2e-5 rad. */
#ifndef BRICKPILOT_TESTS_PEERS_ARC_TANGENT_H
#define BRICKPILOT_TESTS_PEERS_ARC_TANGENT_H

#include "constants.inc"
#include "law.h"

/* Of 0..1. */
static num octant(num ratio)
{
    const num square = num_mul(ratio, ratio);
    num sum = NUM(-0.0389929);

    sum = num_mul(sum, square) + NUM(0.1462766);
    sum = num_mul(sum, square) + NUM(-0.3211819);
    sum = num_mul(sum, square) + NUM(0.9992150);
    return num_mul(sum, ratio);
}

num num_atan2(num y, num x)
{
    const num along_x = x < 0 ? -x : x, along_y = y < 0 ? -y : y;
    num angle;

    if (along_x == 0 && along_y == 0)
        return NUM(0);
    angle = along_y > along_x ? NUM(PI / 2) - octant(num_div(along_x, along_y)) : octant(num_div(along_y, along_x));
    if (x < 0)
        angle = NUM(PI) - angle;
    return y < 0 ? -angle : angle;
}

#endif
