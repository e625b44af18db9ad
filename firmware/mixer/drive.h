/* drive.h: converts the voltage of the model's motor into the voltage that the real motor needs for the same motion.
 *
 * It compensates known differences between one side's drive, motor and wheel and the model, in the order from the wheel
 * to the battery:
 *
 *   motor = wanted + emf * speed + offset + friction in the direction of motion
 *   needed = motor * (1 + gain) + deadband in the direction of motor
 *
 * Below DRIVE_STILL_MM_S_Q4 friction acts in the direction of the wanted voltage. Below this speed, the friction term
 * is 16 times the wanted voltage, up to its full size. The dead band is likewise 16 times `motor`, up to its full
 * size. So noise about zero does not reverse the motor again and again. A configuration of all zeros changes nothing,
 * bit for bit. Negate voltage, speed and offset, and the result is negated.
 */
#ifndef BRICKPILOT_MIXER_DRIVE_H
#define BRICKPILOT_MIXER_DRIVE_H

#include "core/signals.h"

#define DRIVE_STILL_MM_S_Q4 160 /* 10 mm/s */

/* The known values of one side. */
typedef struct {
    int16_t emf_mv_q15;  /* mV per 1/16 mm/s of this side's speed over ground; any value: +-16 V per m/s */
    int16_t offset_mv;   /* -32000..32000 */
    int16_t friction_mv; /* 0..32000 */
    int16_t gain_q15;    /* fraction of the voltage that is added: -32767..32767 = -1..1 */
} drive_side_t;

typedef struct {
    drive_side_t left;
    drive_side_t right;
    int16_t deadband_mv;      /* 0..32000 */
    int16_t half_track_m_q14; /* 0..32767: up to 2 m */
    int16_t reserve_mv;       /* part of the battery's voltage that is kept for these corrections, 0..32000 */
} drive_config_t;

/* The speed over ground that turning adds on the left side and subtracts on the right; saturates. */
int16_t drive_turning_mm_s_q4(const drive_config_t *config, int16_t yaw_rate_mrad_s);

/* The voltage that this side's motor needs, for any `wanted_mv` and `speed_mm_s_q4`. Each sum saturates at +-32767 mV. */
int16_t drive_voltage_mv(const drive_config_t *config, const drive_side_t *side, int16_t wanted_mv,
                         int16_t speed_mm_s_q4);

#endif
