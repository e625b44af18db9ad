/* turns.h: parts of a turn as binary angles. For C and for assembly. */
#ifndef BRICKPILOT_CORE_TURNS_H
#define BRICKPILOT_CORE_TURNS_H

#define TURN_EIGHTH 0x2000
#define TURN_QUARTER 0x4000
#define TURN_HALF 0x8000

#endif
