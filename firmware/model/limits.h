/* limits.h: limits of the model. For C and for assembly. */
#ifndef BRICKPILOT_MODEL_LIMITS_H
#define BRICKPILOT_MODEL_LIMITS_H

#define MOTOR_VOLTAGE_LIMIT_MV 16383

/* 96 rad/s, the high word of mrad/s q13: the sum of two such speeds still fits in 31 bits. */
#define MOTOR_SPEED_LIMIT_MRAD_S_Q13_HIGH 12000

#endif
