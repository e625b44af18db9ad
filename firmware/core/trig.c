#include "core/trig.h"

#include "core/curve.h"
#include "core/fix.h"
#include "core/flash.h"
#include "core/turns.h"

/* Not static: h8/trig.S reads them. */
extern const FLASH curve_t trig_sine_q15, trig_arctan_bam16_q2;

/* Value i is 32767 sin(i / 256 of a quarter turn). Neighbours differ by at most 201: interpolation multiplies 8 x 8
 * bits. */
const FLASH curve_t trig_sine_q15 = {
    .every_8th =
        {
            0,     1608,  3212,  4808,  6393,  7962,  9512,  11039, 12539, 14010, 15446,
            16846, 18204, 19519, 20787, 22005, 23170, 24279, 25329, 26319, 27245, 28105,
            28898, 29621, 30273, 30852, 31356, 31785, 32137, 32412, 32609, 32728, 32767,
        },
    .bends =
        {
            0x00, 0x00, 0x00, 0x00, 0x11, 0x22, 0x33, 0x44, 0x12, 0x23, 0x34, 0x44, 0x11, 0x22, 0x22, 0x11,
            0x11, 0x22, 0x22, 0x21, 0x23, 0x45, 0x66, 0x66, 0x24, 0x56, 0x77, 0x77, 0x24, 0x56, 0x66, 0x54,
            0x35, 0x68, 0x88, 0x87, 0x24, 0x66, 0x76, 0x64, 0x24, 0x55, 0x43, 0x20, 0x35, 0x78, 0x99, 0x86,
            0x35, 0x78, 0x87, 0x53, 0x36, 0x78, 0x88, 0x64, 0x35, 0x78, 0x76, 0x52, 0x46, 0x89, 0x99, 0x75,
            0x36, 0x89, 0xa9, 0x75, 0x36, 0x88, 0x87, 0x52, 0x47, 0xab, 0xba, 0x86, 0x47, 0xab, 0xba, 0x96,
            0x47, 0x9a, 0xa9, 0x74, 0x47, 0x99, 0x97, 0x51, 0x47, 0x9a, 0xa9, 0x63, 0x48, 0xab, 0xba, 0x74,
            0x47, 0x9a, 0xa9, 0x63, 0x47, 0x99, 0x97, 0x40, 0x58, 0xbc, 0xcb, 0x95, 0x47, 0x9a, 0x98, 0x50,
            0x58, 0xbc, 0xba, 0x73, 0x59, 0xbd, 0xdb, 0x95, 0x59, 0xcd, 0xdc, 0xa7, 0x59, 0xcd, 0xdd, 0xa7,
        },
};

/* Value i is atan(i / 256) in units of 1/4 of 1/65536 turn. Neighbours differ by at most 163. */
const FLASH curve_t trig_arctan_bam16_q2 = {
    .every_8th =
        {
            0,     1303,  2604,  3900,  5188,  6467,  7733,  8985,  10221, 11439, 12637,
            13814, 14968, 16100, 17206, 18288, 19344, 20374, 21378, 22355, 23306, 24230,
            25128, 26001, 26848, 27670, 28467, 29241, 29991, 30718, 31423, 32106, 32768,
        },
    .bends =
        {
            0x12, 0x34, 0x56, 0x77, 0x12, 0x33, 0x44, 0x55, 0x11, 0x11, 0x11, 0x00, 0x01, 0x11, 0x11, 0x10,
            0x23, 0x45, 0x66, 0x77, 0x11, 0x22, 0x33, 0x22, 0x12, 0x34, 0x44, 0x44, 0x13, 0x34, 0x45, 0x44,
            0x12, 0x33, 0x33, 0x22, 0x23, 0x45, 0x66, 0x66, 0x12, 0x33, 0x33, 0x21, 0x13, 0x34, 0x44, 0x32,
            0x23, 0x45, 0x55, 0x54, 0x13, 0x44, 0x44, 0x32, 0x23, 0x44, 0x44, 0x32, 0x12, 0x33, 0x33, 0x10,
            0x24, 0x56, 0x77, 0x76, 0x23, 0x45, 0x55, 0x54, 0x12, 0x34, 0x43, 0x21, 0x24, 0x57, 0x77, 0x77,
            0x23, 0x45, 0x55, 0x54, 0x23, 0x44, 0x54, 0x32, 0x23, 0x44, 0x43, 0x21, 0x24, 0x56, 0x77, 0x77,
            0x24, 0x56, 0x67, 0x66, 0x23, 0x56, 0x66, 0x65, 0x24, 0x56, 0x67, 0x66, 0x23, 0x56, 0x66, 0x66,
            0x24, 0x56, 0x77, 0x77, 0x12, 0x33, 0x32, 0x21, 0x12, 0x34, 0x44, 0x43, 0x23, 0x55, 0x66, 0x66,
        },
};

#ifndef FIX_IN_ASSEMBLY
static uint8_t bend(const FLASH curve_t *curve, uint8_t index)
{
    const uint8_t both = curve->bends[index >> 1];
    return index & 1U ? both & 15U : both >> 4;
}

/* The curve's value at `place_q8` (index times 256), interpolated linearly. */
static uint16_t value(const FLASH curve_t *curve, uint16_t place_q8)
{
    const uint8_t index = (uint8_t)(place_q8 >> 8), within = index & 7U;
    const FLASH uint16_t *eighth = &curve->every_8th[index >> 3];
    const uint8_t slope = (uint8_t)((uint16_t)(eighth[1] - eighth[0]) >> 3);
    const uint8_t here = within == 0 ? 0 : bend(curve, (uint8_t)(index - 1));
    const uint8_t step = (uint8_t)(slope + bend(curve, index) - here);
    const uint16_t product = (uint16_t)((uint16_t)step * (uint8_t)place_q8);

    return (uint16_t)(eighth[0] + (uint16_t)((uint16_t)slope * within) + here + ((uint16_t)(product + 128U) >> 8));
}

int16_t trig_sin_q15(uint16_t angle_bam16)
{
    uint16_t half_bam16 = angle_bam16 & (TURN_HALF - 1);
    int16_t sine_q15 = FIX_INT16_MAX;

    if (half_bam16 > TURN_QUARTER)
        half_bam16 = (uint16_t)(TURN_HALF - half_bam16);
    if (half_bam16 != TURN_QUARTER)
        sine_q15 = (int16_t)value(&trig_sine_q15, (uint16_t)(half_bam16 << 2));
    return angle_bam16 >= TURN_HALF ? (int16_t)-sine_q15 : sine_q15;
}

int16_t trig_cos_q15(uint16_t angle_bam16)
{
    return trig_sin_q15((uint16_t)(angle_bam16 + TURN_QUARTER));
}

/* Angle of a vector of the first octant, 0..1/8 turn; 0 <= minor <= major. */
static uint16_t octant_bam16(uint16_t minor, uint16_t major)
{
    if (minor == 0)
        return 0;
    if (minor == major)
        return TURN_EIGHTH;
    return (uint16_t)(value(&trig_arctan_bam16_q2, (uint16_t)fix_div_u32((uint32_t)minor << 16, major)) + 2U) >> 2;
}

uint16_t trig_atan2_bam16(int32_t y, int32_t x)
{
    uint32_t across = fix_abs_u32(y), along = fix_abs_u32(x);
    uint16_t angle_bam16;

    while ((across | along) >> 16 != 0) {
        across >>= 1;
        along >>= 1;
    }
    if (across <= along)
        angle_bam16 = octant_bam16((uint16_t)across, (uint16_t)along);
    else
        angle_bam16 = (uint16_t)(TURN_QUARTER - octant_bam16((uint16_t)along, (uint16_t)across));
    if (x < 0)
        angle_bam16 = (uint16_t)(TURN_HALF - angle_bam16);
    return y < 0 ? (uint16_t)(0U - angle_bam16) : angle_bam16;
}
#endif
