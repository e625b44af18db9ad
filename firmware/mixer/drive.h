/* drive.h: from the voltage that the model's motor would get to the voltage that this motor needs for the same.
 *
 * What one side's drive, motor and wheel are found to do otherwise than the model says, undone in the order from the
 * wheel to the battery:
 *
 *   motor = wanted + emf * speed + offset + friction in the direction of motion
 *   needed = motor * (1 + gain) + deadband in the direction of motor
 *
 * Below DRIVE_STILL_MM_S_Q4 friction counts in the direction of the voltage wanted. There, and for the dead band, it
 * grows with 16 times that voltage up to its size, so that noise about zero does not throw the motor to and fro.
 * All zero changes nothing, bit for bit. Negate voltage, speed and offset, and the result is negated.
 */
#ifndef BRICKPILOT_MIXER_DRIVE_H
#define BRICKPILOT_MIXER_DRIVE_H

#include "core/signals.h"

#define DRIVE_STILL_MM_S_Q4 160 /* 10 mm/s */

/* What is known of one side. */
typedef struct {
    int16_t emf_mv_q15;  /* mV per 1/16 mm/s of this side's speed over ground, any: +-16 V per m/s */
    int16_t offset_mv;   /* -20000..20000 */
    int16_t friction_mv; /* 0..20000 */
    int16_t gain_q15;    /* of the voltage, beyond 1: -32767..32767 = -1..1 */
} drive_side_t;

typedef struct {
    drive_side_t left;
    drive_side_t right;
    int16_t deadband_mv;      /* 0..20000 */
    int16_t half_track_m_q14; /* 0..32767: up to 2 m */
    int16_t reserve_mv;       /* 0..20000: of the battery's voltage, kept for all of the above */
} drive_config_t;

/* What turning adds to the speed of the left side over ground, and takes from that of the right; saturates. */
int16_t drive_turning_mm_s_q4(const drive_config_t *config, int16_t yaw_rate_mrad_s);

/* `wanted_mv` and `speed_mm_s_q4` any; every sum on the way saturates at +-32767 mV. */
int16_t drive_voltage_mv(const drive_config_t *config, const drive_side_t *side, int16_t wanted_mv,
                         int16_t speed_mm_s_q4);

#endif
