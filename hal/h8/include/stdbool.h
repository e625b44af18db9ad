#ifndef BRICKPILOT_H8_STDBOOL_H
#define BRICKPILOT_H8_STDBOOL_H

#define bool _Bool
#define true 1
#define false 0

#endif
