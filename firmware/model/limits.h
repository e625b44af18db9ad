/* limits.h: limits of the model. For C and for assembly. */
#ifndef BRICKPILOT_MODEL_LIMITS_H
#define BRICKPILOT_MODEL_LIMITS_H

/* The unit of the model's voltages is 2^MOTOR_VOLTAGE_BITS mV. If the battery voltage is above the limit below,
 * `brickpilot firmware` sets 1 here and makes the coefficients for voltages in units of 2 mV. */
#define MOTOR_VOLTAGE_BITS 0

/* Limit of the model's voltages: the sum of two voltages still fits in 16 bits. */
#define MOTOR_VOLTAGE_LIMIT_MV 16383

/* Limit of a motor's speed, 96 rad/s, as the high word of mrad/s q13: the sum of two speeds still fits in 31 bits. */
#define MOTOR_SPEED_LIMIT_MRAD_S_Q13_HIGH 12000

#endif
